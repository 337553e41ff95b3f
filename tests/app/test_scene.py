"""The 3D actuator: its solids, what a run looks like on it, playback, and the pace of poses in a browser."""

from __future__ import annotations

import io
import itertools
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support.on_page import wait_until
from support.one_tab import Tab

from ema_model.actuator import load_actuator
from ema_model.commands import command
from ema_model.faults import vector
from ema_model.simulation.run import Run, simulate_reference
from emaviz.page.app import tabs
from emaviz.page.style import STRIP_HEIGHT_PX
from emaviz.page.window_layout import LEFT_PX, _width_px
from emaviz.scene import actuator as actuator_scene
from emaviz.scene import solids
from emaviz.scene.actuator import _NAMES, NAMED_AT, ActuatorScene
from emaviz.scene.labels import Label, lay_out
from emaviz.scene.playback import Playback, enlargement, motion
from emaviz.scene.solids import BOXES, FAULT, RESIDUAL, frame
from emaviz.server.safe_server import open_server
from emaviz.session.explore import Simulation

SOLIDS = {
    "block": solids.block(1.0, 2.0, 3.0),
    "pipe": solids.tube(0.0, 1.0, 0.2, 0.3),
    "cut pipe": solids.tube(0.0, 1.0, 0.2, 0.3, 0.3, 4.0),
    "ball": solids.ball(0.5),
    "wheel": solids.gear_wheel(14, 0.1, 0.0, 0.1),
    "thread": solids.thread(0.0, 1.0, 0.05, 0.05, 0.01),
    "housing": actuator_scene._housing(),
    "stator": actuator_scene._stator(),
    "flap": actuator_scene._flap(),
}


class Recorder:
    """A scene that remembers what it is told."""

    def __init__(self):
        self.poses, self.damages, self.told = [], [], []

    def pose(self, *values):
        self.poses.append(values)

    def damage(self, *values):
        self.damages.append(values)

    def tell(self, *values):
        self.told.append(values)


@pytest.fixture(scope="module")
def actuator():
    return load_actuator()


def run_of(actuator, **faults):
    k = vector(faults)
    return simulate_reference(Run(), actuator, k), k


@pytest.mark.parametrize("name", SOLIDS)
def test_a_solid_is_made_of_real_triangles(name):
    solid = SOLIDS[name]
    assert solid.faces.max() < len(solid.vertices) and np.all(np.isfinite(solid.vertices))
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    areas = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert areas.min() > 0.0


def test_the_whole_actuator_has_few_triangles():
    parts = (
        actuator_scene._housing(),
        actuator_scene._stator(),
        actuator_scene._rotor_core(),
        actuator_scene._flap(),
        actuator_scene._rails(),
    )
    assert sum(len(part.faces) for part in parts) < 6000


@pytest.mark.parametrize("name", [name for name in SOLIDS if name not in ("thread", "stator")])
def test_a_solid_is_seen_from_outside(name):
    """Its volume is positive when its triangles look outward; a thread is open, and the stator's parts overlap."""
    solid = SOLIDS[name]
    a, b, c = (solid.vertices[solid.faces[:, i]].astype(float) for i in range(3))
    volume = np.sum(a * np.cross(b, c)) / 6.0
    unsigned = np.sum(np.abs(np.sum(a * np.cross(b, c), axis=1))) / 6.0
    assert volume > 0.01 * unsigned > 0.0
    edges = np.concatenate([solid.faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    ends = np.round(solid.vertices[edges].astype(float), 5)
    whole = {tuple(end.ravel()) for end in ends}
    back = {tuple(end[::-1].ravel()) for end in ends}
    assert len(whole & back) > 0.97 * len(whole), "each edge is run through once in either direction"


def test_a_block_has_its_volume_and_a_turn_keeps_it():
    block = solids.block(1.0, 2.0, 3.0)
    for solid in (block, block.turned(0.7), block.across(), block.moved(1.0, 2.0, 3.0)):
        a, b, c = (solid.vertices[solid.faces[:, i]].astype(float) for i in range(3))
        assert np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(6.0, rel=1e-5)


def test_positive_azimuths_and_turns_agree():
    turned = solids.block(0.1, 0.1, 0.1).moved(y=1.0).turned(0.5 * np.pi)
    assert turned.vertices.mean(axis=0) == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    w, x, y, z = solids.about_x(0.5 * np.pi)
    assert (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)) == pytest.approx((0.0, 0.0, 1.0))


@pytest.mark.parametrize("turn", [-0.6, -0.2, 0.0, 0.3, 0.6])
def test_the_rod_keeps_its_length(turn):
    _, at_rest = actuator_scene._rod_of(0.0)
    pin, rod = actuator_scene._rod_of(turn)
    assert np.hypot(*rod) == pytest.approx(np.hypot(*at_rest), rel=1e-9)
    assert pin[1] == pytest.approx(actuator_scene._SCREW_Z + actuator_scene._PIN_Z)
    assert (pin[0] > actuator_scene._NUT_X) == (turn > 0.0) or turn == 0.0


@pytest.mark.parametrize("largest, factor", [(0.005, 100.0), (0.03, 20.0), (0.2, 3.0), (2.0, 1.0), (0.0, 1.0)])
def test_motion_is_enlarged_by_round_numbers(largest, factor):
    assert enlargement(largest) == factor


def test_a_run_is_shown_as_it_is(actuator):
    run, k = run_of(actuator, k3=0.5)
    shown = motion(run, k, actuator)
    assert np.array_equal(shown.motor_rad, run["motor_position_rad"]), "the rotor is to scale"
    assert shown.surface_rad == pytest.approx(100.0 * run["user_position_rad"])
    assert shown.turns == (0.5, 1.0, 1.0)
    brightest = np.abs(shown.glow).max()
    assert 0.5 < brightest <= 1.001
    phase_a = run["phase_a_current_A"]
    assert shown.glow[:, 0] * shown.full_A == pytest.approx(phase_a)
    assert "× 100" in shown.sentence() and f"{shown.full_A:g} A" in shown.sentence()


def test_play_moves_the_nut_from_one_jaw_to_the_other(actuator):
    loose = motion(*run_of(actuator, k2=0.8), actuator)
    tight = motion(*run_of(actuator), actuator)
    assert loose.room > 10.0 * tight.room > 0.0
    assert loose.play.max() > 0.45 * loose.room and loose.play.min() < -0.45 * loose.room
    assert np.all(np.abs(loose.play) <= 0.5 * loose.room + 1e-12)


@pytest.fixture(scope="module")
def scene():
    server = open_server("127.0.0.1", 0)
    yield ActuatorScene(server)
    server.stop()


def drawn_nodes(scene, actuator, **faults):
    """By name, what of each node is drawn: its colour, its text, its turn and place, its triangles."""
    shown = motion(*run_of(actuator, **faults), actuator)
    shown.damage(scene)
    scene.pose(0.0, 0.0)
    nodes = scene._server.scene._handle_from_node_name
    drawn = {}
    for name, node in nodes.items():
        if node is not None and node.visible:
            looks = [getattr(node, one, None) for one in ("color", "text")]
            drawn[name] = (
                *looks,
                *np.round(node.wxyz, 3),
                *np.round(node.position, 4),
                len(getattr(node, "faces", ())),
            )
    return drawn


@pytest.mark.parametrize(
    "fault, text, place",
    [
        ("k1", "friction × 2.40", "motor/bearings"),
        ("k2", "shown × 400", "drive/nut/jaw_low/block"),
        ("k3", "phase A: 30 % of turns", "motor/burnt"),
        ("k4", "phase B: 30 % of turns", "motor/burnt"),
        ("k5", "phase C: 30 % of turns", "motor/burnt"),
        ("k6", "ζ = 0.70\nshown × 20", "motor/axis/rotor/thinnest_gap"),
        ("k7", "+72°\n(no effect: ζ = 0)", "motor/axis/rotor/direction"),
        ("k8", "gain × 1.20", "controller/front"),
    ],
)
def test_each_fault_is_said_and_marked_at_its_place(scene, actuator, fault, text, place):
    healthy = drawn_nodes(scene, actuator)
    broken = drawn_nodes(scene, actuator, **{fault: 0.7})
    assert FAULT not in {node[0] for node in healthy.values()}, "a healthy machine has nothing in the fault colour"
    marked = {name for name, node in broken.items() if node[0] == FAULT}
    assert f"/actuator/{place}" in marked and len({name.split("/")[2] for name in marked}) == 1, "one place alone"
    assert text in broken[f"/labels/{fault}"][1]
    assert not [name for name in healthy if name.startswith("/labels/k")]
    again = drawn_nodes(scene, actuator)
    assert again == healthy, "mended, it looks as it did"


@pytest.mark.parametrize("fault, part", [("k1", "bearing"), ("k2", "nut"), ("k4", "phase_b"), ("k6", "rotor")])
def test_a_part_that_a_callout_names_has_no_second_label(scene, actuator, fault, part):
    assert f"/labels/{part}" in drawn_nodes(scene, actuator)
    broken = drawn_nodes(scene, actuator, **{fault: 0.7})
    assert f"/labels/{fault}" in broken and f"/labels/{part}" not in broken


def test_the_eccentric_rotor_is_off_towards_its_mark(scene, actuator):
    drawn_nodes(scene, actuator, k6=0.7, k7=0.7)
    scene.pose(1.2, 0.0)
    w, x, *_ = scene._motor._thinnest.wxyz
    off = np.array(scene._motor._axis.position)
    towards = 2.0 * np.arctan2(x, w) + 1.2
    assert np.arctan2(off[2], off[1]) == pytest.approx(np.arctan2(np.sin(towards), np.cos(towards)))


def test_the_load_is_an_arrow_on_the_surface(scene, actuator):
    def shown(load):
        """Which way its tail points, and its length; None without an arrow."""
        run = simulate_reference(Run(load_torque_Nm=load), actuator)
        told = motion(run, vector({}), actuator)
        told.pose(scene, 0.1)
        assert told.load_says == (f"load {load:g} N·m".replace("-", "−") if load else "")
        w, _, y, _ = scene._load._frame.wxyz
        return (-2.0 * w * y, scene._load._shaft.scale[0]) if scene._load._frame.visible else None

    assert shown(0.0) is None
    assert shown(20.0) == pytest.approx((1.0, 0.26)), "from above"
    assert shown(-20.0) == pytest.approx((-1.0, 0.26))
    assert shown(15.0) == pytest.approx((1.0, 0.75 * 0.26)), "where 20 is the longest"


def test_the_drive_says_its_bus_and_its_delay(actuator):
    assert actuator_scene.said(actuator) == "controller and inverter\n48 V bus"
    late = replace(actuator, effects={"computation_delay": {"delay_s": 1e-4}})
    assert actuator_scene.said(late) == "controller and inverter\n48 V bus, delay 0.100 ms"


def test_labels_leave_the_motor_to_be_seen(actuator):
    shown = motion(*run_of(actuator, k1=0.25, k2=0.7, k3=0.3, k6=0.5), actuator)
    said = [Label(one.fault, one.text, one.place, callout=True) for one in shown.callouts]
    said += [Label("drive", shown.drive_says, NAMED_AT), *_NAMES]
    for picture in pictures():
        view = frame(picture[0] / picture[1])
        corners = (view.seen(list(itertools.product(*BOXES[0])))[:, :2] * (1.0, -1.0) + 1.0) * 0.5 * picture
        low, high = corners.min(axis=0), corners.max(axis=0)
        boxes = [one.box() for one in lay_out(said, view, picture)]
        covered = [np.prod(np.clip(np.minimum(high, one[2:]) - np.maximum(low, one[:2]), 0.0, None)) for one in boxes]
        assert sum(covered) < (0.1 if picture[0] > 340 else 0.3) * np.prod(high - low)


ALL = {f"k{i}": 0.7 for i in range(1, 9)}


@pytest.mark.parametrize("faults", [{}, *({name: 0.7} for name in ALL), ALL])
def test_labels_do_not_cover_each_other(scene, actuator, faults):
    shown = motion(*run_of(actuator, **faults), actuator)
    said = [Label(one.fault, one.text, one.place, callout=True) for one in shown.callouts]
    said += [Label("drive", shown.drive_says, NAMED_AT), *_NAMES]
    for picture in pictures():
        placed = lay_out(said, frame(picture[0] / picture[1]), picture)
        boxes = np.array([one.box() for one in placed])
        apart = (boxes[:, None, :2] > boxes[None, :, 2:]).any(2) | (boxes[:, None, 2:] < boxes[None, :, :2]).any(2)
        assert np.all(apart | np.eye(len(boxes), dtype=bool))
        assert boxes[:, :2].min() >= 0.0 and np.all(boxes[:, 2:] <= picture)
        told = {one.label.name for one in placed}
        assert faults.keys() <= told or (faults == ALL and picture[0] < 400), "every fault is said"
        assert len(placed) >= (len(said) if picture[0] > 550 and len(faults) < 2 else 0.6 * len(said))


def test_a_label_stays_at_its_line_however_the_actuator_is_turned(scene, actuator):
    """A line that ends at the middle of a text ends there from every side; at its edge, from the first one alone."""
    motion(*run_of(actuator, k1=0.7, k2=0.7, k3=0.7), actuator).damage(scene)
    labels = scene._labels
    ends = [end for lines in labels._lines.values() if lines is not None for end in lines.points[:, 0]]
    middles = np.array(
        [labels._handles[name].position for name, sent in labels._sent.items() if name in labels._handles]
    )
    assert len(ends) >= 5
    for end in ends:
        assert np.abs(middles - end).max(axis=1).min() < 1e-5


def resting_for(growing, seconds):
    """Whether a list stays as long as it is."""
    length = len(growing)
    time.sleep(seconds)
    return len(growing) == length


def test_playback_plays_pauses_and_seeks(actuator):
    run, k = run_of(actuator, k6=0.4)
    scene, told = Recorder(), []
    playback = Playback(scene, actuator, lambda on, time_s, duration_s: told.append((time_s, duration_s)))
    try:
        began = time.monotonic()
        playback.show(Simulation(run, run, k, 0.0))
        wait_until(lambda: len(scene.poses) > 5 and len(told) > 5 and scene.damages)
        assert scene.damages[-1][1] == pytest.approx(0.4)
        times = [time_s for time_s, _ in told]
        assert times == sorted(times) and 0.0 < times[-1], times
        assert times[-1] <= 0.1 * (time.monotonic() - began) + 0.01, "ten times slower than life"
        playback.play(False)
        wait_until(lambda: resting_for(scene.poses, 0.15))
        resting = len(scene.poses)
        playback.seek(0.25)
        wait_until(lambda: told[-1] == (0.25, pytest.approx(0.5)) and len(scene.poses) > resting)
        assert resting_for(scene.poses, 0.15) and len(scene.poses) == resting + 1
        assert scene.poses[-1][0] == pytest.approx(np.interp(0.25, run.time_s, run["motor_position_rad"]))
        playback.seek(float("nan"))
        playback.seek(99.0)
        wait_until(lambda: told[-1][0] == pytest.approx(0.5))
        assert resting_for(told, 0.15), "no further than the end"
    finally:
        playback.close()


def test_a_shorter_run_is_played_from_within(actuator):
    scene = Recorder()
    playback = Playback(scene, actuator, lambda *_: None)
    try:
        playback.play(False)
        for duration in (0.5, 0.1):
            run = simulate_reference(Run(command("step"), duration), actuator)
            playback.show(Simulation(run, run, vector({}), 0.0))
            playback.seek(0.4)
            wait_until(lambda: playback.time_s == pytest.approx(min(0.4, duration)), 10.0)  # noqa: B023
    finally:
        playback.close()


def test_the_picture_gives_way_to_the_charts_of_a_browser_that_is_behind(actuator):
    playback = Playback(Recorder(), actuator, lambda *_: None)
    try:

        def pace(between_runs_s, runs=6, ago_s=0.0):
            playback._came_s.extend([-1e9] * 6)
            playback._came_s.extend(time.monotonic() - ago_s - between_runs_s * np.arange(runs)[::-1])
            return playback._pace

        assert pace(0.05, runs=1) == pace(2.0) == 0.2, "a single change, whose charts come first"
        assert pace(0.05, runs=1, ago_s=0.3) == pace(2.0, ago_s=0.3) == 30.0
        assert pace(0.05) == 15.0, "a slider sends its value every 50 ms"
        assert pace(0.08) == pace(0.08, runs=2) == 0.2, "from the second run on"
    finally:
        playback.close()


class Meshes:
    """A scene that keeps the meshes that are in it."""

    def __init__(self):
        self.there = {}

    def add_mesh_simple(self, name, vertices, faces, **given):
        mesh = self.there[name] = SimpleNamespace(faces=len(faces), remove=lambda: self.there.pop(name), **given)
        return mesh

    def __getattr__(self, name):
        return lambda *_, **given: SimpleNamespace(**given)


def test_coils_burn_from_the_first_shorted_turn_on():
    scene = Meshes()
    one = actuator_scene.Motor(scene, "/m", 2)
    loop = len(actuator_scene._loop(1.0).faces)
    for turns, burnt in (((1.0, 1.0, 1.0), 0), ((0.97, 1.0, 1.0), 2), ((0.5, 1.0, 0.25), 8 + 12), ((0.02, 1, 1), 16)):
        one.damage(turns, 0.0, 0.0)
        one.glow((0.0, 1.0, 0.5))
        black = scene.there.get("/m/burnt")
        assert (black.faces if black else 0) == burnt * loop
        coils = [scene.there.get(f"/m/coil_{phase}") for phase in "abc"]
        assert sum(coil.faces for coil in coils if coil) == (48 - burnt) * loop
        assert coils[1].faces == 16 * loop and min(coils[1].color) > 120, "full current in all turns of phase B"
    assert coils[0] is None, "all of phase A is burnt"


def test_where_a_model_fails_the_screw_has_the_residuals_colour(scene, actuator):
    healthy = drawn_nodes(scene, actuator)
    scene.pose(0.0, 0.0, heat=1.0)
    nodes = scene._server.scene._handle_from_node_name
    hot = [name for name in healthy if getattr(nodes[name], "color", None) == RESIDUAL]
    assert len(hot) == 1 and RESIDUAL != FAULT
    assert drawn_nodes(scene, actuator) == healthy, "it cools down"


WINDOWS = ((1400, 900), (1920, 1080), (1100, 700))


def pictures():
    """Sizes of the picture that the panels leave, in px."""
    shares = {one.workspace.share for one in tabs()}
    return [(w - LEFT_PX - _width_px(w, share), h - STRIP_HEIGHT_PX) for w, h in WINDOWS for share in shares]


@pytest.mark.parametrize("width, height", [*pictures(), (200, 900), (1800, 400)])
def test_the_whole_machine_fills_the_picture(width, height):
    corners = np.array([corner for box in BOXES for corner in itertools.product(*box)])
    shown = frame(width / height)
    seen = shown.seen(corners)
    least, most = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    assert np.all(least > -0.95) and np.all(most < 0.95) and np.all(seen[:, 2] > 0.0), "nothing is cut"
    assert np.max((most - least) / 2.0) > 0.8, "as near as can be"
    assert least == pytest.approx(-most, abs=0.1), "in the middle"
    if (width, height) in pictures():
        assert np.prod((most - least) / 2.0) > 0.5, "not half of the picture is empty"
    assert shown.at(*seen[7]) == pytest.approx(corners[7])


@pytest.fixture
def drawn(browser, app):
    """A tab in which the scene is drawn."""
    tab = Tab(browser, app, scene=True)
    app.session.refresh()
    app.strip.play(False)
    yield tab.as_new()
    tab.check()
    tab.close()


@pytest.mark.browser
def test_the_actuator_is_drawn_between_the_panels(drawn):
    """By WebGL itself, which calm pages do without; what a shader cannot be made of is an error of the page."""
    middle = {"x": 450, "y": 250, "width": 450, "height": 400}

    def colours():
        picture = Image.open(io.BytesIO(drawn.screenshot(clip=middle))).convert("RGB")
        return len(picture.getcolors(middle["width"] * middle["height"]))

    wait_until(lambda: colours() > 300, 30.0)
    drawn.add_style_tag(content="canvas { visibility: hidden !important }")
    wait_until(lambda: colours() < 100, 10.0)


@pytest.mark.long
@pytest.mark.browser
def test_the_rotor_in_the_browser_follows_the_run_at_a_pace(drawn, app):
    """Poses that reach the browser; drawing them all at 25/s needs two free cores and is measured in benchmarks."""
    drawn.evaluate(
        """() => { window.__poses = new Set(); const watch = () => {
             const pose = window.__viserMutable.nodePoseData['/actuator/motor/axis/rotor'];
             if (pose) window.__poses.add(String(pose.wxyz)); requestAnimationFrame(watch); }; watch(); }"""
    )
    app.strip.play(True)
    drawn.wait_for_timeout(3000)
    assert drawn.evaluate("window.__poses.size") > 9


@pytest.mark.long
@pytest.mark.browser
def test_the_camera_frames_the_machine_between_the_panels_until_somebody_moves_it(drawn, app):
    """In a window that becomes smaller, too; and again after Reset view."""
    client = next(iter(app.server.get_clients().values()))

    def framed():
        camera = client.camera
        return np.allclose(camera.position, frame(camera.image_width / camera.image_height).position, atol=0.03)

    def picture():
        box = drawn.locator("canvas").first.bounding_box()
        left, right = (drawn.locator(f"[data-dock-region={side}]").bounding_box() for side in ("left", "right"))
        return box["x"] >= left["x"] + left["width"] - 1 and box["x"] + box["width"] <= right["x"] + 1 and box["width"]

    wait_until(lambda: framed() and 550 < picture() < 650, 30.0)
    drawn.set_viewport_size({"width": 1100, "height": 700})
    wait_until(lambda: framed() and 340 < picture() < 400, 30.0)
    box = drawn.locator("canvas").first.bounding_box()
    x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    drawn.mouse.move(x, y)
    drawn.mouse.down()
    drawn.mouse.move(x - 80, y - 40, steps=4)
    drawn.mouse.up()
    wait_until(lambda: not framed(), 30.0)
    drawn.set_viewport_size({"width": 1400, "height": 900})
    wait_until(lambda: 550 < picture() < 650, 30.0)
    assert not framed(), "the user's view is left alone"
    drawn.get_by_role("button", name="Reset view").click()
    wait_until(framed, 30.0)


@pytest.mark.browser
def test_without_a_gpu_edges_are_hard_and_motion_comes_first(browser, app):
    """Smooth ones take a third of the time of a picture."""
    page = browser.new_page(drawn=True, viewport={"width": 1000, "height": 650})
    try:
        page.goto(app.address)
        # three.js names its canvas as it takes the context: one that is asked before that gets another context
        drawn = "[...document.querySelectorAll('canvas[data-engine]')].find(one => one.width > 300 && one.height > 300)"
        page.wait_for_function(f"{drawn} !== undefined", timeout=60_000)
        smooth = f"() => {drawn}.getContext('webgl2').getContextAttributes().antialias"
        assert page.evaluate(smooth) is False
    finally:
        page.close()
