"""The figures: what is drawn, that no text is cut, and that a file is whole or absent."""

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from PIL import Image

from repaint_cli.envs.gymnasium.reacher import plot_reacher
from repaint_cli.envs.racer import road
from repaint_cli.envs.racer.deepracer.traces import Trace
from repaint_cli.envs.racer.path_figure import plot_racer
from repaint_cli.envs.racer.road import Road, draw_road
from repaint_cli.envs.racer.sweep import cell_of, sweep
from repaint_cli.envs.racer.training_figures import plot_heatmap, plot_progress
from repaint_cli.errors import StoreError
from repaint_cli.report import style
from repaint_cli.report.curves import plot_curves, spread
from repaint_cli.report.path_panels import PathPanel

NAN = np.nan
ANGLES = np.linspace(0, 2 * np.pi, 60)
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
RING[-1] = RING[0]
OVAL = {"inner": RING * [3.0, 1.5], "centre": RING * [3.4, 1.9], "outer": RING * [3.8, 2.3]}


@pytest.fixture
def drawn(monkeypatch) -> Iterator[list[Figure]]:
    """The figures saved during a test, still open to questions."""
    figures: list[Figure] = []
    save = style.save
    monkeypatch.setattr(
        style, "save", lambda figure, path: (save(figure, path), figures.append(figure))
    )
    return figures


def curves(n_seeds=3, n_iterations=20, best=400.0):
    noise = np.random.default_rng(0).normal(0, 20, (n_seeds, n_iterations))
    return best * (1 - np.exp(-np.arange(n_iterations) / 5)) + noise


def laps(label="iteration 5 · return 212 · progress 63 %", n_episodes=4):
    turns = np.linspace(0, 5, 80) + np.arange(n_episodes)[:, None]
    xy = np.stack([3.4 * np.cos(turns), 1.9 * np.sin(turns)], axis=2)
    xy[0, 28:30] *= 1.6  # off the map
    xy[0, 30:] = NAN
    speed = np.where(np.isnan(xy[:, :, 0]), NAN, 0.7 + 0.3 * np.sin(turns))
    return PathPanel(xy, label, values=speed, exits=xy[:1, 29])


def reaches(label="iteration 60 · return −4.9", n_episodes=20):
    generator = np.random.default_rng(0)
    goals = generator.uniform(-0.14, 0.14, (n_episodes, 2))
    share = np.linspace(0, 0.95, 51)[:, None]
    return PathPanel(goals[:, None] * share + (1 - share) * [0.21, 0.0], label, target=goals)


def overhang(figure):
    """How far what is drawn sticks out of the figure, in pixels; 0 if nothing is cut."""
    box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
    return figure.dpi * max(-box.x0, -box.y0, box.x1 - width, box.y1 - height, 0.0)


def draw_every_kind(folder):
    plot_heatmap(training(), **OVAL, path=folder / "heat.png", title="racer-outer: repaint")
    plot_progress(training(), np.arange(1.0, 9.0), folder / "far.png", "racer-outer: repaint")
    methods = {name: curves(best=300 + 20 * i) for i, name in enumerate(style.METHOD_COLOURS)}
    progress = {name: np.clip(values / 4, 0, 100) for name, values in methods.items()}
    plot_curves(
        methods,
        folder / "curves.png",
        title="racer-outer: transfer from racer-inner, " + "a title on two lines, " * 4,
        progress=progress,
        reference=(380.0, "scratch’s best"),
        transfer_iterations=4,
    )
    plot_curves({"scratch": curves(1)}, folder / "one.png", title="reacher")
    for count in (1, 2, 4, 6):
        plot_racer(
            [laps()] * count, [Road(**OVAL)], path=folder / f"racer{count}.png", title="racer-outer"
        )
        plot_reacher([reaches()] * count, folder / f"reacher{count}.png", "reacher")


def test_nothing_is_cut_and_every_file_is_a_picture(drawn, tmp_path):
    draw_every_kind(tmp_path)
    assert len(drawn) == 12
    assert max(overhang(figure) for figure in drawn) <= 1.0
    for figure in drawn:  # and nothing pushed the panels into a corner
        assert sum(axes.bbox.width * axes.bbox.height for axes in figure.axes) > 0.4 * np.prod(
            figure.bbox.size
        )
    for path in tmp_path.iterdir():
        with Image.open(path) as picture:
            assert picture.format == "PNG"


def test_axes_have_names_and_units(drawn, tmp_path):
    path, share = tmp_path / "x.png", {"repaint": curves() / 4}
    plot_curves({"repaint": curves()}, path, title="t", progress=share)
    plot_racer([laps()], [Road(**OVAL)], path=path, title="t")
    plot_reacher([reaches()], path, "t")
    names = [[axes.get_ylabel() for axes in figure.axes] for figure in drawn]
    assert names[0] == ["mean evaluation return", "mean lap progress [%]"]
    assert names[1:] == [["y [m]", "speed [m/s]"], ["y [m]", "time [steps]"]]
    assert [figure.axes[-1 if i == 0 else 0].get_xlabel() for i, figure in enumerate(drawn)] == [
        "iteration",
        "x [m]",
        "x [m]",
    ]


def test_the_same_figure_is_the_same_file(tmp_path):
    for name in ("a.png", "b.png"):
        plot_curves({"repaint": curves()}, tmp_path / name, title="reacher")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def bold_line(axes, label):
    (line,) = (line for line in axes.lines if line.get_label() == label)
    return line


def test_a_seed_that_stops_ends_the_mean_but_not_the_others(drawn, tmp_path):
    returns = np.array([[1.0, 2.0, 3.0, NAN], [3.0, 4.0, 5.0, 9.0]])
    plot_curves({"repaint": returns}, tmp_path / "c.png", title="t")
    (axes,) = drawn[0].axes
    assert_allclose(bold_line(axes, "repaint").get_xydata(), [[1, 2], [2, 3], [3, 4]])
    assert_allclose(axes.lines[1].get_xydata()[-1], [4, 9])


def test_only_three_seeds_or_more_have_a_band(drawn, tmp_path):
    for n_seeds in (1, 2, 3):
        plot_curves({"repaint": curves(n_seeds)}, tmp_path / "c.png", title="t")
    assert [len(figure.axes[0].collections) for figure in drawn] == [0, 0, 1]


@pytest.mark.parametrize("shape", [(0, 5), (2, 0), (3, 1), (1, 1)], ids=str)
def test_little_data_is_no_error(shape, tmp_path):
    plot_curves({"repaint": np.ones(shape)}, tmp_path / "c.png", title="t")
    plot_curves({"repaint": np.full(shape, NAN)}, tmp_path / "c.png", title="t")


def test_a_method_keeps_its_colour_whatever_else_is_drawn():
    alone = style.colours_of(["repaint"])
    among = style.colours_of(["racer-inner", "kickstart", "repaint", "repaint ζ 0.4"])
    assert among["repaint"] == alone["repaint"] == style.METHOD_COLOURS["repaint"]
    assert len(set(among.values())) == 4


def test_names_move_apart_and_no_farther_than_needed():
    assert spread([0.1, 0.5], 0.1) == [0.1, 0.5]
    assert_allclose(spread([0.5, 0.5, 0.5], 0.1), [0.4, 0.5, 0.6])
    assert_allclose(spread([0.0, 0.5, 0.52], 0.1), [0.0, 0.46, 0.56])
    assert spread([], 0.1) == []


def test_paths_end_where_the_episode_ends_and_the_cross_is_there(drawn, tmp_path):
    paths = laps()
    plot_racer([paths], [Road(**OVAL)], path=tmp_path / "t.png", title="t")
    axes = drawn[0].axes[0]
    (line,) = axes.collections
    assert len(line.get_segments()) == 29 + 3 * 79
    assert_allclose(axes.lines[-1].get_xydata(), paths.xy[:1, 29])
    assert_allclose(line.get_array()[:29], paths.values[0, 1:30])


def test_a_car_sweeps_its_width_once_an_episode_with_the_mean_of_its_values():
    way = np.stack([np.linspace(0.203, 0.803, 13), np.full(13, 0.503)], axis=1)
    there_and_back = np.concatenate([way, way[::-1]])
    xy = np.full((3, 26, 2), NAN)
    xy[0], xy[1, :13], xy[2, :1] = there_and_back, way, [[0.1, 0.1]]
    values = np.full((3, 26), NAN)
    values[0], values[1, :13] = 2.0, 4.0
    passed, means = sweep(xy, values, np.zeros(2), np.ones(2))
    assert passed.shape == means.shape == (100, 100)
    rows, columns = np.nonzero(passed == 2)
    assert len(rows) == np.count_nonzero(passed)  # and no cell on the way is left out
    assert (columns.min(), columns.max()) == (20, 80)
    assert (rows.min(), rows.max()) == (40, 59)
    assert len(rows) == 61 * 20
    assert_allclose(means[rows, columns], 3.0)
    assert np.isnan(means[passed == 0]).all()


def test_crashes_have_a_sign_of_their_own(drawn, tmp_path):
    paths = replace(laps(), crashes=laps().xy[1:2, -1])
    plot_racer([paths], [Road(**OVAL)], path=tmp_path / "t.png", title="t")
    exits, crashes = drawn[0].axes[0].lines[-2:]
    assert_allclose(exits.get_xydata(), paths.xy[:1, 29])
    assert_allclose(crashes.get_xydata(), paths.xy[1:2, -1])
    names = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert names == ["inner lane", "outer lane", "start", "left the track", "crashed"]


def test_a_car_far_off_the_track_is_still_in_the_picture(drawn, tmp_path):
    plot_racer([laps(), laps()], [Road(**OVAL)], path=tmp_path / "t.png", title="t")
    for axes in drawn[0].axes[:2]:
        assert axes.viewLim.contains(*laps().xy[0, 29])


def test_panels_share_one_speed_scale(drawn, tmp_path):
    slow, fast = laps(), laps()
    slow.values[:] *= 0.3
    plot_racer([slow, fast], [Road(**OVAL)], path=tmp_path / "t.png", title="t")
    left, right = (axes.collections[0].norm for axes in drawn[0].axes[:2])
    assert (left.vmin, left.vmax) == (right.vmin, right.vmax)
    assert left.vmin < 0.3 < 0.9 < left.vmax


def test_paths_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="values is"):
        PathPanel(np.zeros((2, 5, 2)), "x", values=np.zeros((2, 4)))


def training(n_iterations=8, n_episodes=5):
    """A car that comes farther with every iteration; iteration 2 belongs to the teacher."""
    drives = []
    for k in [k for k in range(1, n_iterations + 1) if k != 2]:
        for e in range(n_episodes):
            turns = np.linspace(e, e + 2 * np.pi * k / n_iterations, 40)
            xy = np.stack([3.4 * np.cos(turns), 1.9 * np.sin(turns)], axis=1)
            status = "lap_complete" if k == n_iterations else ("off_track", "crashed")[e % 2]
            nothing = {field.name: np.zeros(40) for field in fields(Trace)}
            progress = np.linspace(0, 100 * k / n_iterations, 40)
            known = {"x": xy[:, 0], "y": xy[:, 1], "progress": progress, "status": status}
            drives.append((k, Trace(**nothing | known)))
    return drives


def greys_at(lines, points):
    """What colours the road has at some points, as hexadecimal texts."""
    figure = style.new_figure(4, 4)
    axes = figure.subplots()
    draw_road(axes, *lines)
    axes.set(xlim=(-4, 4), ylim=(-4, 4))
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())
    columns, rows = axes.transData.transform(points).T.astype(int)
    return [to_hex(colour / 255) for colour in picture[len(picture) - rows, columns, :3]]


@pytest.mark.parametrize("sense", [1, -1])
def test_a_lane_is_filled_and_the_field_inside_is_not(sense):
    lines = [OVAL[name][::sense] for name in ("inner", "outer", "centre")]
    found = greys_at(lines, [(3.6, 0.1), (3.2, 0.1), (0, 0), (3.6, 3)])
    assert found == [road.OUTER_LANE, road.INNER_LANE, "#ffffff", "#ffffff"]


def test_an_open_road_is_filled_between_its_lines_alone():
    x = np.linspace(0, np.pi, 30)
    inner, centre, outer = (np.stack([np.cos(x), np.sin(x)], axis=1) * r for r in (1, 2, 3))
    found = greys_at((inner, outer, centre), [(0, 2.5), (0, 1.5), (0, 0.5), (0, -1)])
    assert found == [road.OUTER_LANE, road.INNER_LANE, "#ffffff", "#ffffff"]


def test_a_large_field_has_larger_cells():
    small, large = cell_of(np.zeros(2), np.array([8.0, 5.0])), cell_of(np.zeros(2), np.full(2, 40))
    assert small == 0.01
    assert (40 / large) ** 2 == pytest.approx(500_000)


def test_a_scale_fits_small_rewards_and_does_not_magnify_noise(drawn, tmp_path):
    for span in (0.02, 1e-5):
        some = laps()
        some.values[:] = 0.005 + span * some.values
        plot_racer([some], [Road(**OVAL)], path=tmp_path / "t.png", title="t")
    small, noise = (figure.axes[0].collections[0].norm for figure in drawn)
    assert 0.005 < small.vmin < small.vmax < 0.03
    assert noise.vmax - noise.vmin == pytest.approx(0.0005, rel=0.1)


def test_the_heat_map_has_four_quarters_and_all_bad_ends(drawn, tmp_path):
    drives = training()
    plot_heatmap(drives, **OVAL, path=tmp_path / "h.png", title="t")
    panels = drawn[0].axes[:4]
    assert [axes.get_title() for axes in panels] == [
        "iteration 1 · 5 episodes · 0 % laps",
        "iterations 3 to 4 · 10 episodes · 0 % laps",
        "iterations 5 to 6 · 10 episodes · 0 % laps",
        "iterations 7 to 8 · 10 episodes · 50 % laps",
    ]
    counts = [np.ma.filled(axes.collections[0].get_array(), 0).sum() for axes in panels]
    assert counts == [40 * 5, 40 * 10, 40 * 10, 40 * 10]
    signs = [[len(line.get_xdata()) for line in axes.lines[-2:]] for axes in panels]
    assert signs == [[3, 2], [6, 4], [6, 4], [3, 2]]
    assert (
        len({(axes.collections[0].norm.vmin, axes.collections[0].norm.vmax) for axes in panels})
        == 1
    )


def test_a_training_of_one_iteration_has_pictures_too(drawn, tmp_path):
    for drives in (training(1), []):
        plot_heatmap(drives, **OVAL, path=tmp_path / "h.png", title="t")
        plot_progress(drives, np.array([3.0]), tmp_path / "p.png", "t")
    titles = [[axes.get_title() for axes in figure.axes[:4]] for figure in drawn[::2]]
    assert titles == [
        ["iteration 1 · 5 episodes · 100 % laps", ""],  # and the colour bar
        ["no episodes", ""],
    ]


def test_a_short_training_has_a_part_an_iteration_and_the_colours_have_a_top(drawn, tmp_path):
    plot_heatmap(training(3), **OVAL, path=tmp_path / "h.png", title="t")
    *panels, bar = drawn[0].axes
    titles = [axes.get_title() for axes in panels if axes.get_visible()]
    assert [title.split(" · ")[0] for title in titles] == ["iteration 1", "iteration 3"]
    ticks = bar.get_yticks()
    assert ticks[-1] == max(axes.collections[0].get_array().max() for axes in panels)
    assert (np.diff(np.log(ticks)) > 0.2).all()


def test_progress_tells_training_from_evaluation(drawn, tmp_path):
    plot_progress(training(), np.arange(1.0, 9.0), tmp_path / "p.png", "t")
    (axes,) = drawn[0].axes
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    assert len(lines["training episode"]) == 35
    assert_allclose(lines["their mean"], [[k, 12.5 * k] for k in (1, 3, 4, 5, 6, 7, 8)])
    assert_allclose(lines["whole laps [%]"][:, 1], [0] * 6 + [100])
    assert_allclose(lines["mean of the evaluation"], [[k, k] for k in range(1, 9)])


def test_a_failure_leaves_the_old_file_and_no_scraps(tmp_path, monkeypatch):
    def torn(_, path, **__):
        path.write_text("new")
        raise RuntimeError("half way")

    monkeypatch.setattr(style.FigureCanvasAgg, "print_png", torn)
    path = tmp_path / "curves.png"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="half way"):
        style.save(style.new_figure(1, 1), path)
    assert [entry.name for entry in tmp_path.iterdir()] == ["curves.png"]
    assert path.read_text() == "old"


def test_a_file_in_the_way_is_explained(tmp_path):
    (tmp_path / "run").write_text("a file where the folder should be")
    with pytest.raises(StoreError, match="cannot write"):
        plot_curves({"repaint": curves()}, tmp_path / "run" / "curves.png", title="t")
