"""Pages in a browser: a silent console, every picture shown, both schemes, a phone's width."""

import shutil

import pytest
from written_runs import climb, draw, write_run

import repaint_cli
from repaint_cli.runs.run_page import write_run_page

playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright, of [dev]")

pytestmark = pytest.mark.slow

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
HOSTILE = "</script><img src=x onerror=alert(1)><script>alert(2)"


@pytest.fixture(scope="module")
def browser():
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip(f"needs a browser: {' or '.join(BROWSERS)}")
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=path, args=FLAGS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The page of a run, and that of a comparison whose names are hostile."""
    home = tmp_path_factory.mktemp("pages")
    taught = write_run(
        home / "two", climb(speed=2), "repaint", ["gentle"], ["ppo.gamma=0.9"], taught=6,
        alarms=[(2, "nothing-kept", "no teacher sample was kept, so nothing was taught; " * 3)],
    )  # fmt: skip
    write_run(home / "one", climb(speed=8))
    write_run(home / HOSTILE, climb(speed=4))
    for name in ("trajectories", "heatmap"):
        draw(home / "two" / f"{name}.png")
    folders = [home / "one", home / "two", home / HOSTILE, home / "one"]
    repaint_cli.compare(folders[:3], reference=home / "one", report=home / "report")
    return {"run": write_run_page(taught), "comparison": home / "report" / "report.html"}


def visit(browser, path, width=1100, scheme="light"):
    """Open a page; return it and what it complained of or asked the network for."""
    context = browser.new_context(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page, complaints = context.new_page(), []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("dialog", lambda dialog: (complaints.append(dialog.message), dialog.dismiss()))
    page.on(
        "request",
        lambda request: (
            request.url.startswith(("file:", "data:")) or complaints.append(request.url)
        ),
    )
    page.goto(path.as_uri())
    page.locator("#chart svg").wait_for()
    return page, complaints


@pytest.mark.parametrize("width", [1100, 400])
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("kind", ["run", "comparison"])
def test_a_page_is_shown_whole_and_without_a_word_in_the_console(
    browser, pages, kind, scheme, width
):
    page, complaints = visit(browser, pages[kind], width, scheme)
    widths = page.evaluate("[...document.images].map(image => image.naturalWidth)")
    if kind == "run":
        assert widths == [60] * 2
    else:  # profiles and K(target) first
        assert widths[2:] == [60]
        assert min(widths[:2]) > 1000
    assert page.evaluate("document.documentElement.scrollWidth") == width
    sizes = page.evaluate(
        "[...document.querySelectorAll('.scroll')].map(box => [box.scrollWidth, box.clientWidth])"
    )
    shown = [size for size in sizes if size[1]]
    assert all(client <= width for _, client in shown)
    if width == 400:  # some table is wider, and scrolls
        assert any(scroll > client for scroll, client in shown)
    clipped = page.evaluate(
        """[...document.querySelectorAll('#chart text')].filter(text => {
          const box = text.getBoundingClientRect();
          const frame = text.ownerSVGElement.getBoundingClientRect();
          return box.left < frame.left - 1 || box.right > frame.right + 1
            || box.top < frame.top - 1 || box.bottom > frame.bottom + 1;
        }).map(text => text.textContent)"""
    )
    assert clipped == []
    assert complaints == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_line_stands_out_from_the_paper(browser, pages, scheme):
    page, _ = visit(browser, pages["comparison"], scheme=scheme)
    paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
    lines = page.evaluate(
        "[...document.querySelectorAll('#chart .mean')].map(line => getComputedStyle(line).stroke)"
    )
    assert len(lines) == len(set(lines)) == 3
    text = page.evaluate("getComputedStyle(document.body).color")
    assert contrast(text, paper) > 7
    least = 2.2 if scheme == "light" else 3  # Okabe and Ito's sky blue and orange are light
    assert min(contrast(line, paper) for line in lines) > least


def contrast(one, other):
    """The contrast of two colours, rgb(r, g, b), as WCAG 2 has it."""
    light = []
    for colour in (one, other):
        parts = [int(part) / 255 for part in colour[4:-1].split(",")]
        linear = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        light.append(sum(w * p for w, p in zip((0.2126, 0.7152, 0.0722), linear, strict=True)))
    return (max(light) + 0.05) / (min(light) + 0.05)


def test_curves_go_over_steps_and_time_and_the_target_can_be_chosen(browser, pages):
    page, complaints = visit(browser, pages["comparison"])
    texts = "[...document.querySelectorAll('#chart text')].map(text => text.textContent)"
    assert "iteration" in page.evaluate(texts)
    page.get_by_label("environment steps").check()
    assert "environment steps" in " ".join(page.evaluate(texts))
    page.get_by_role("radio", name="time").check()
    assert "time [s]" in page.evaluate(texts)
    page.get_by_label("β").check()
    assert "β, weight of the pull to the teacher" in page.evaluate(texts)
    page.get_by_role("radio", name="return").check()
    page.locator("#target").select_option(index=0)
    tables = page.locator("[data-target]:visible")
    assert tables.count() == 1
    chosen = page.locator("#target option").first.inner_text()
    assert f"To a mean return of {chosen}" in tables.inner_text()
    assert f"target {chosen}" in page.evaluate(texts)
    boxes = page.locator("#legend input")
    for i in range(boxes.count()):
        boxes.nth(i).uncheck()
    assert page.evaluate(texts) == ["Nothing to draw: choose a run below."]
    assert complaints == []


def test_the_numbers_under_the_pointer_are_shown(browser, pages):
    page, complaints = visit(browser, pages["run"])
    page.locator("#chart svg").hover(position={"x": 400, "y": 100})
    said = page.locator("#readout").inner_text()
    assert said.startswith("iteration: ")
    assert "repaint from gentle: -" in said
    assert complaints == []


@pytest.mark.parametrize(
    ("target", "shown"), [(-5.5, True), (-1, True), (1e6, False)], ids=["near", "above", "far"]
)
def test_a_target_far_from_every_curve_does_not_flatten_them(browser, pages, target, shown):
    report = pages["run"].parent.parent / f"far-{target}"
    repaint_cli.compare([pages["run"].parent], target=target, report=report)
    page, complaints = visit(browser, report / "report.html")
    assert page.locator("#chart .target").count() == shown
    assert complaints == []
