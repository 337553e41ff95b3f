/* One instance of the exported model, as both versions of FMI take it. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model.h" /* the exported model under general names, and the token of its description */

/* Value references, as modelDescription.xml has them. */
enum { TIME, COMMAND, LOAD, SUPPLY, OUTPUTS, INITIAL = OUTPUTS + 4, PARAMETERS = INITIAL + 4 };

#define PARAMETER_COUNT (sizeof(model_parameters) / sizeof(double))

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } Phase;

typedef struct {
    Phase phase;
    double time;
    double inputs[3];
    double initial[4]; /* user position, motor speed, place in the play, integral action */
    model_parameters parameters;
    model_state state;
} Instance;

static Instance *new_instance(void)
{
    Instance *it = calloc(1, sizeof(Instance));
    if (it) {
        it->parameters = model_defaults;
        it->inputs[SUPPLY - COMMAND] = 1.0;
    }
    return it;
}

static void reset_instance(Instance *it)
{
    memset(it, 0, sizeof(Instance));
    it->parameters = model_defaults;
    it->inputs[SUPPLY - COMMAND] = 1.0;
}

static void begin(Instance *it)
{
    model_init(&it->state, &it->parameters, it->initial[0], it->initial[1], it->initial[2]);
    it->state.integral = it->initial[3];
    it->state.time = it->time;
    model_sense(&it->state, &it->parameters);
}

/* Whether a value could be read. */
static int read_value(Instance *it, unsigned reference, double *value)
{
    if (it->phase < STEPPING)
        begin(it);
    if (reference == TIME)
        *value = it->time;
    else if (reference < OUTPUTS)
        *value = it->inputs[reference - COMMAND];
    else if (reference == OUTPUTS)
        *value = model_current(&it->state, &it->parameters);
    else if (reference == OUTPUTS + 1)
        *value = model_motor_speed(&it->state, &it->parameters);
    else if (reference == OUTPUTS + 2)
        *value = model_motor_position(&it->state, &it->parameters);
    else if (reference == OUTPUTS + 3)
        *value = model_user_position(&it->state, &it->parameters);
    else if (reference < PARAMETERS)
        *value = it->initial[reference - INITIAL];
    else if (reference < PARAMETERS + PARAMETER_COUNT)
        *value = ((const double *)&it->parameters)[reference - PARAMETERS];
    else
        return 0;
    return 1;
}

/* Whether a value could be set: inputs always, what is fixed only before the first step. */
static int write_value(Instance *it, unsigned reference, double value)
{
    if (reference >= COMMAND && reference < OUTPUTS)
        it->inputs[reference - COMMAND] = value;
    else if (it->phase >= STEPPING)
        return 0;
    else if (reference >= INITIAL && reference < PARAMETERS)
        it->initial[reference - INITIAL] = value;
    else if (reference >= PARAMETERS && reference < PARAMETERS + PARAMETER_COUNT)
        ((double *)&it->parameters)[reference - PARAMETERS] = value;
    else
        return 0;
    return 1;
}

/* A communication step: as many of the model's own steps as fill it, under inputs that stay; whether it stayed finite. */
static int do_step(Instance *it, double size)
{
    double count = floor(size / MODEL_STEP_S + 0.5);
    const long steps = count < 1.0 ? 1 : (long)count;
    for (long i = 0; i < steps; i++)
        model_step(&it->state, &it->parameters, it->inputs[0], it->inputs[1], it->inputs[2], size / (double)steps);
    it->time += size;
    return isfinite(it->state.theta) && isfinite(it->state.omega);
}

static Instance *copy_of(const Instance *it)
{
    Instance *copy = malloc(sizeof(Instance));
    if (copy)
        *copy = *it;
    return copy;
}

#endif
