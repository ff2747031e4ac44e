"""The report: one page that needs nothing else, tells all that there is, and shows each figure under its own name."""

import base64
import html
import io
import json
import subprocess
from collections import Counter
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image
from small_study import NO_PARAMS
from workflow_runs import job_of, jobs_of, quick_config, snakemake

from fibrous_study import datasets
from fibrous_study.audit.checks import CHECKS
from fibrous_study.audit.verdict import Verdict
from fibrous_study.audit.wording import worded
from fibrous_study.config import PROJECT, loaded
from fibrous_study.datasets import read_table
from fibrous_study.paper import section
from fibrous_study.provenance import commit, record
from fibrous_study.report.headline import SENTENCES, headline
from fibrous_study.report.outline import OUTLINE, SECTIONS, TARGETS, exhibits, figures, name_of
from fibrous_study.report.page import page as page_of
from fibrous_study.report.readme import duration, filled
from fibrous_study.report.tables import VIEWS, shown
from fibrous_study.schema import Field, Table
from fibrous_study.steps import report, stage_costs

LINKING = {"src", "href", "srcset", "action", "data", "poster", "xlink:href"}


class Page(HTMLParser):
    """What a page links to, its ids, images by the figure they stand in, badges and text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links: list[str] = []
        self.ids: list[str] = []
        self.images: dict[str, str] = {}
        self.open: list[str] = []
        self.figure = ""
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.links += [value for name, value in found.items() if name in LINKING]
        self.ids += [found["id"]] if "id" in found else []
        if tag == "figure":
            self.figure = found["id"]
        if tag == "img":
            self.images[self.figure] = found["src"]
            assert found["alt"]
        if tag not in ("meta", "link", "img", "br"):
            self.open.append(tag)
        assert tag != "script"

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.words += data


@pytest.fixture(scope="module")
def page(quick) -> Page:
    return Page((quick[0] / "results/report.html").read_text(encoding="utf-8"))


def test_every_tag_is_closed_and_every_id_there_once(page):
    assert page.open == []
    assert len(set(page.ids)) == len(page.ids)


def test_nothing_lies_outside_the_page(page):
    outside = [link for link in page.links if not link.startswith(("data:", "#"))]
    assert outside == []
    assert {link[1:] for link in page.links if link.startswith("#")} <= set(page.ids)


def svg_of(figure: str) -> str:
    return job_of(quick_config(), figure).content["outputs"]["svg"]


def test_every_image_is_the_figure_of_its_name_and_can_be_decoded(quick, page):
    assert list(page.images) == list(figures())
    for stage, link in page.images.items():
        kind, _, content = link.partition(",")
        assert kind == "data:image/svg+xml;base64"
        svg = base64.b64decode(content, validate=True)
        assert svg == (quick[0] / svg_of(stage)).read_bytes()
        root = ElementTree.fromstring(svg)
        assert root.tag.endswith("svg")
        for image in root.iter("{http://www.w3.org/2000/svg}image"):
            inner = image.get("{http://www.w3.org/1999/xlink}href").partition("base64,")[2]
            Image.open(io.BytesIO(base64.b64decode(inner))).load()


def test_the_page_tells_every_statement_with_its_verdict(quick, page):
    claims = worded(pd.read_csv(quick[0] / "results/claims.csv"), section("statements"))
    assert {claim.id for claim in claims} <= set(page.ids)
    words = " ".join(page.words.split())
    for claim in claims:
        for text in (claim.says, claim.here, claim.spread, claim.verdict, claim.why):
            assert " ".join(text.split()) in words
    for verdict, count in Counter(claim.verdict for claim in claims).items():
        assert f"{verdict}{count} of {len(claims)} statements" in words.replace("\n", "")


def test_the_page_says_where_its_numbers_come_from(quick, page):
    assert commit(PROJECT) in page.words
    stages = pd.read_csv(quick[0] / "results/tables/stages.csv")
    assert f"{stages['cpu_seconds'].sum() / 3600:.3g} in {stages['jobs'].sum()} jobs" in page.words
    assert str(stages["machine"].iloc[0]) in page.words
    shown_config = yaml.safe_load(page.words[page.words.index("seed: 2021\nnetwork:") :])
    whole = quick_config()
    assert shown_config == {key: whole[key] for key in shown_config}
    assert set(whole) - set(shown_config) == {"microstructure", "sensitivity"}
    assert "differs from the default one in cube, delaunay, replicates, synthetic_specimen." in page.words


def test_every_statement_of_the_paper_stands_below_a_figure_or_table():
    assert {entry["under"] for entry in section("statements")} <= {name_of(one) for one in exhibits()}


def test_every_contradiction_is_settled_by_statements_that_are_judged(quick, page):
    contradictions = section("contradictions")
    settled = [id for one in contradictions for id in one["statements"]]
    assert len(set(settled)) == len(settled)
    assert set(settled) <= set(CHECKS)
    verdicts = pd.read_csv(quick[0] / "results/claims.csv").groupby("claim")["verdict"].first()
    for one in contradictions:
        assert one["verdict"] in set(Verdict)
        assert one["topic"] in page.words
        # What follows from a verdict is written where that is the verdict.
        assert (one["settled"] in page.words) == (verdicts[one["statements"][0]] == one["verdict"])


def test_every_figure_and_table_of_the_study_has_its_place():
    drawn = {job.rule for job in jobs_of(quick_config()) if job.rule.startswith("figure_")}
    assert set(figures()) == drawn
    assert {one["table"] for one in exhibits() if "table" in one} <= set(VIEWS)
    assert set(OUTLINE["verdicts"]) == set(Verdict)


def test_snakemakes_own_report_shows_figures_and_tables(quick, tmp_path):
    done = snakemake(quick[0], f"--report={tmp_path / 'report.html'}")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    for part in SECTIONS:
        if any("figure" in one for one in part["exhibits"]):
            assert json.dumps(part["title"]) in text
    for one in figures().values():
        assert json.dumps(one["title"]) in text
        assert one["caption"].rpartition("What to see: ")[2] in html.unescape(text)
    assert '"Tables"' in text


# Tables ------------------------------------------------------------------------------------------------------------


def test_a_table_keeps_the_rows_and_columns_that_the_schema_shows():
    table = pd.DataFrame({"a": [1.0, 2.0], "b": ["x", ""], "c": [0.123456, np.nan]})
    columns = {"c": Field("1", "", "third"), "a": Field("1", "", "first"), "b": Field("text", "")}
    assert shown(table, Table("p", columns, {"b": ("x",)})) == (["third", "first"], [["0.123", "1"]])
    assert shown(table, Table("p", columns))[1] == [["0.123", "1"], ["", "2"]]
    assert shown(table, Table("p", columns, {"b": ("y", "")}))[1] == [["", "2"]]


def test_load_sets_keep_their_sections():
    table = pd.DataFrame({"set": ["section_3_1"]})
    assert shown(table, Table("p", {"set": Field("text", "", "set")}))[1] == [["section 3.1"]]


def test_a_table_of_laws_says_what_they_are():
    law = {
        "law": "families",
        "constants": "fit",
        "energy": "structure_tensor",
        "objective": "energy",
        "run": "hgo_refit",
    }
    found = shown(pd.DataFrame([law]), Table("p", {"run": Field("text", "", "run")}, law="law"))
    assert found == (["law", "run"], [["Eq. 2 fitted, Eq. 10C run", "hgo refit"]])


def test_text_is_text_and_no_markup():
    words = Page(page_of("a < b", table=(["<i>"], [["<script>alert(1)</script>"]]))).words
    assert "<script>alert(1)</script>" in words
    assert "a < b" in words


def test_every_table_of_the_report_shows_rows(quick):
    for name, declared in VIEWS.items():
        if "sensitivity" not in name:
            assert shown(read_table(quick[0] / declared.path, name), declared)[1], name


# What it costs -----------------------------------------------------------------------------------------------------


def test_costs_are_summed_over_what_a_target_waits_for(tmp_path):
    """Two batches of networks, curves of each, a fit of both, and a figure of one batch."""
    stages = ["networks", "networks", "curves", "curves", "fits", "figure"]
    reads = [[], [], [0], [1], [2, 3], [2]]
    files = []
    for i, spent in enumerate((1.0, 2.0, 4.0, 8.0, 16.0, 32.0)):
        path = tmp_path / f"{i}.csv"
        datasets.write_table(pd.DataFrame({"a": [i]}), path, NO_PARAMS)
        beside = tmp_path / f"{i}.csv.json"
        said = json.loads(beside.read_text()) | {"cpu_seconds": spent, "peak_memory_MB": 10.0 * spent}
        beside.write_text(json.dumps(said))
        files.append(path)
        params = {"stage": f"fibrous_study.steps.{stages[i]}", "config": {}, "code_hash": ""}
        record(path, params, {str(tmp_path / f"{j}.csv"): "" for j in reads[i]}, str(i))
    targets = {"figure": ["figure"], "curves": ["curves"], "fits": ["fits"]}
    outputs = {name: tmp_path / f"{name}.csv" for name in ("stages", "targets")}
    stage_costs.run({"files": files}, outputs, NO_PARAMS | {"config": {"targets": targets}})
    found = pd.read_csv(outputs["targets"]).set_index("target")
    assert found["cpu_seconds"].to_dict() == {"figure": 37.0, "curves": 15.0, "fits": 31.0, "all": 63.0}
    assert found["jobs"].to_dict() == {"figure": 3, "curves": 4, "fits": 5, "all": 6}
    found = pd.read_csv(outputs["stages"]).set_index("stage")
    assert found["cpu_seconds"].to_dict() == {"networks": 3.0, "curves": 12.0, "fits": 16.0, "figure": 32.0}
    assert found["largest_peak_memory_MB"].to_dict() == {
        "networks": 20.0,
        "curves": 80.0,
        "fits": 160.0,
        "figure": 320.0,
    }
    assert found["reads"].fillna("").to_dict() == {
        "networks": "",
        "curves": "networks",
        "fits": "curves",
        "figure": "curves",
    }


def test_targets_are_those_of_the_workflow():
    rules = " ".join(path.read_text() for path in (PROJECT / "workflow/rules").glob("*.smk"))
    rules += (PROJECT / "Snakefile").read_text()
    for target in TARGETS:
        assert f"rule {target}:" in rules


# Words -------------------------------------------------------------------------------------------------------------


def table_2(times: float) -> pd.DataFrame:
    rows = [
        ("hybrid", "a", "finite elements, initial and refit", 0.02, 0.02, np.nan, np.nan),
        ("hybrid", "a", "total", 0.1, 1.48, np.nan, np.nan),
        ("multiscale", "coupled", "t", 0.1 * times, 2622.69, times, 1772.1),
        ("multiscale", "one_step", "t", 0.02, np.nan, 0.2, np.nan),
    ]
    columns = ["method", "runs", "task", "cpu_hours", "paper_cpu_hours", "times_hybrid", "times_hybrid_paper"]
    return pd.DataFrame(rows, columns=columns).assign(specimen="synthetic specimen")


def test_the_headline_says_what_the_tables_hold(monkeypatch):
    verdicts = [Verdict.REPRODUCED.value] * 2 + [Verdict.PARTLY.value] * 2  # the last statement has two quantities
    claims = pd.DataFrame({"claim": list("abcc"), "verdict": verdicts})
    laws = [
        ("affine", None, None, 0, 0.05),
        ("families", "structure_tensor", "energy", 1, 1.25),
        ("families", "structure_tensor", "energy", 0, 0.75),
        ("families", "families", "energy", 0, 0.09),
        ("families", "families", "stress", 0, 0.01),
    ]
    columns = ["law", "energy", "objective", "refits", "shear_stress_relative_rms_error"]
    comparison = pd.DataFrame(laws, columns=columns).assign(specimen="synthetic specimen")
    numbers = {"claims": "{count}: {verdicts}", "errors": "{laws}"}
    numbers["costs"] = "{multiscale_minutes:.3g} {hybrid_minutes:.3g} {outside} {times_hybrid} {times_hybrid_paper}"
    laws = [{**law, "words": law["law"]} for law in SENTENCES["laws"]]
    monkeypatch.setattr("fibrous_study.report.headline.SENTENCES", {**numbers, "laws": laws})
    assert headline({"claims": claims, "table_2": table_2(0.5), "comparison": comparison}) == [
        "3: 2 reproduced, 1 partly",
        "3 6 80 % 0.5 1772.1",
        "families 75 % → 125 %; families 9 %; affine 5 %",
    ]


def test_blocks_are_put_between_their_marks():
    page = "a\n<!-- x -->\nold\n<!-- end of x -->\nb"
    assert filled(page, {"x": "new \\1"}) == "a\n<!-- x -->\nnew \\1\n<!-- end of x -->\nb"
    with pytest.raises(datasets.DatasetError, match="the page must hold '<!-- y -->'"):
        filled(page, {"y": "new"})


def test_durations():
    assert [duration(one) for one in (0.4, 119.0, 121.0, 3600.0)] == ["0 s", "119 s", "2 min", "60 min"]


def test_a_note_names_what_differs_from_the_default_config():
    def notes(config: dict) -> list[str]:
        return report._notes(job_of(config, "report").params["config"]["other_than_default"])

    assert notes(loaded()) == []
    assert "in matrix." in notes(loaded() | {"matrix": {"C1_MPa": 1.0, "lame_lambda_MPa": 1.0}})[0]


def test_the_commit_is_the_last_one_that_touched_what_results_are_made_of(tmp_path, monkeypatch):
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=tmp_path, check=True, capture_output=True, text=True).stdout.strip()

    for variable in ("GIT_AUTHOR_NAME", "GIT_AUTHOR_EMAIL", "GIT_COMMITTER_NAME", "GIT_COMMITTER_EMAIL"):
        monkeypatch.setenv(variable, "someone")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert commit(tmp_path) == "not a git checkout"
    git("init", "--quiet")
    source, page = tmp_path / "src" / "a.py", tmp_path / "README.md"
    source.parent.mkdir()
    source.write_text("1\n")
    git("add", ".")
    git("commit", "--quiet", "-m", "a source")
    first = git("rev-parse", "HEAD")
    page.write_text("words\n")
    git("add", ".")
    assert commit(tmp_path) == first
    git("commit", "--quiet", "-m", "words")
    assert commit(tmp_path) == first
    source.write_text("2\n")
    assert commit(tmp_path) == f"{first} with changes since"
    git("commit", "--quiet", "-am", "another source")
    assert commit(tmp_path) == git("rev-parse", "HEAD")
