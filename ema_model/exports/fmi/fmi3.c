/* FMI 3.0 co-simulation. */
#include "fmi3Functions.h"

#include "instance.h"

#define OK_IF(condition) return (condition) ? fmi3OK : fmi3Error

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference intermediate[], size_t count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    if (token && strcmp(token, MODEL_TOKEN) != 0) {
        if (log)
            log(environment, fmi3Error, "error", "the instantiation token is another model's");
        return NULL;
    }
    return new_instance();
}

void fmi3FreeInstance(fmi3Instance instance)
{
    free(instance);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    Instance *it = instance;
    it->phase = INITIALIZING;
    it->time = start;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    Instance *it = instance;
    begin(it);
    it->phase = STEPPING;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ((Instance *)instance)->phase = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    reset_instance(instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
    fmi3Float64 values[], size_t value_count)
{
    for (size_t i = 0; i < count; i++)
        if (i >= value_count || !read_value(instance, references[i], &values[i]))
            return fmi3Error;
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count,
    const fmi3Float64 values[], size_t value_count)
{
    for (size_t i = 0; i < count; i++)
        if (i >= value_count || !write_value(instance, references[i], values[i]))
            return fmi3Error;
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    free(*state);
    *state = copy_of(instance);
    OK_IF(*state);
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    *(Instance *)instance = *(const Instance *)state;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    *size = sizeof(Instance);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (size < sizeof(Instance))
        return fmi3Error;
    memcpy(bytes, state, sizeof(Instance));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size != sizeof(Instance) || !(*state ? *state : (*state = new_instance())))
        return fmi3Error;
    memcpy(*state, bytes, sizeof(Instance));
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 point, fmi3Float64 size, fmi3Boolean no_set_before,
    fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    Instance *it = instance;
    const int is_finite = do_step(it, size);
    *event = *terminate = *early = fmi3False;
    *last = it->time;
    OK_IF(is_finite);
}
