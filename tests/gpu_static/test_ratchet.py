"""What the comparison with recorded figures finds, and what it says; and that page and record agree."""

from __future__ import annotations

import copy

import pytest
from gpu_static import compilers, occupancy, page, ratchet
from gpu_static import figures as figures_of
from gpu_static.collect import Use, Variant
from gpu_static.compilers import MORE, TARGETS

MOST_TARGETS = (*TARGETS, *MORE)


@pytest.fixture
def figures():
    """Figures of two variants of a kernel, none wrong."""
    cheap = {"group": 64, **{target: {"registers": 64} for target in TARGETS}}
    cheap["sm_90"] = {"registers": 64, "instructions": 74.2}
    dear = copy.deepcopy(cheap)
    dear["sm_90"] |= {"registers": 80, "instructions": 101.5}
    return {"a.cl FP64=1 TAPS=2": {"sum": cheap}, "a.cl FP64=1 TAPS=4": {"sum": dear}}


def test_equal_figures_are_neither_worse_nor_better(figures):
    assert ratchet.worse(figures, copy.deepcopy(figures)) == ([], []) and ratchet.limits(figures) == []


@pytest.mark.parametrize("name, words", [("registers", "registers"), ("instructions", "instructions per contribution")])
def test_a_figure_above_the_recorded_one_names_variant_got_wanted_and_remedy(figures, name, words):
    before = copy.deepcopy(figures)
    figures["a.cl FP64=1 TAPS=2"]["sum"]["sm_90"][name] = 90
    (said,), below = ratchet.worse(figures, before)
    wanted = before["a.cl FP64=1 TAPS=2"]["sum"]["sm_90"][name]
    assert said.startswith(f"a.cl FP64=1 TAPS=2: kernel sum on sm_90: 90 {words}, recorded {wanted}.")
    assert "make gpu-static ARGS=--record" in said and not below
    above, (better,) = ratchet.worse(before, figures)
    assert not above and f"recorded {90}" in better


def test_a_variant_without_figures_may_cost_what_the_costliest_of_its_kernel_does(figures):
    before = copy.deepcopy(figures)
    figures["a.cl FP64=1 TAPS=3"] = copy.deepcopy(figures["a.cl FP64=1 TAPS=4"])
    assert ratchet.worse(figures, before) == ([], [])
    figures["a.cl FP64=1 TAPS=3"]["sum"]["sm_90"]["instructions"] = 102
    (said,), _ = ratchet.worse(figures, before)
    assert "a.cl FP64=1 TAPS=3" in said and "recorded 101.5 at most, for variants of this kernel" in said
    (said,), _ = ratchet.worse({"a.cl FP64=0 TAPS=2": figures["a.cl FP64=1 TAPS=2"]}, before)
    assert "a.cl FP64=0 TAPS=2: kernel sum has no recorded figures" in said


@pytest.mark.parametrize(
    "figure, words",
    [({"spills": 8}, "8 bytes or registers that spill, wanted none"), ({"stack": 48}, "48 bytes of stack, wanted none"),
     ({"local memory": 49153}, "49153 bytes of local memory, wanted at most 49152"),
     ({"error": "no type 'x'"}, "no type 'x'")],
)  # fmt: skip
def test_what_no_gpu_should_run_is_named(figures, figure, words):
    figures["a.cl FP64=1 TAPS=2"]["sum"]["gfx90a"] |= figure
    (said,) = ratchet.limits(figures)
    assert said.startswith("a.cl FP64=1 TAPS=2: kernel sum on gfx90a") and words in said


def test_kernels_for_images_fit_a_multiprocessor_twice_or_have_a_reason(figures):
    plenty = {"registers": 129}  # two groups of 256 work-items have 128 registers each
    found = {"nufft2d.cl FP64=1": {"sum": {"group": 256, **{target: {"registers": 64} for target in MOST_TARGETS}}}}
    assert not ratchet.limits(found)
    found["nufft2d.cl FP64=1"]["sum"]["sm_120"] = plenty
    (said,) = ratchet.limits(found)
    assert "nufft2d.cl FP64=1: kernel sum on sm_120: one group on a multiprocessor, wanted 2" in said
    assert not ratchet.limits({"spread_points.cl VW=1": found["nufft2d.cl FP64=1"]})  # no image
    alone = next(iter(ratchet.MAY_BE_ALONE))
    assert not ratchet.limits({f"{alone} VW=1": found["nufft2d.cl FP64=1"]})


def test_kernels_that_may_spill_have_no_stack_and_spill_no_more_than_recorded(figures):
    (file, *_) = ratchet.MAY_SPILL
    sums = figures["a.cl FP64=1 TAPS=2"]
    found = {f"{file} FP64=1": copy.deepcopy(sums)}
    found[f"{file} FP64=1"]["sum"]["gfx90a"] |= {"spills": 8}
    assert not ratchet.limits(found)
    (said,), _ = ratchet.worse(found, {f"{file} FP64=1": sums})
    assert "8 bytes or registers that spill, recorded" in said
    found[f"{file} FP64=1"]["sum"]["gfx90a"] |= {"stack": 8}
    assert len(ratchet.limits(found)) == 1


def test_files_that_no_task_uses_and_reasons_that_hold_no_longer_are_named(figures):
    missing = [line for line in ratchet.coverage(figures) if "no task of tests/gpu_static/tasks.py" in line]
    assert any("kernels/backproject.cl" in line for line in missing)
    assert not any("backproject_lines.cl" in line for line in missing)
    built = ratchet.coverage({"backproject_lines.cl VW=1": {}})
    assert any("backproject_lines.cl is launched on GPUs" in line for line in built)


def test_the_record_is_json_and_is_what_the_page_shows():
    record = ratchet.recorded()
    assert ratchet.RECORD.read_text() == ratchet.text_of(record)
    text = page.PAGE.read_text()
    assert page.written(text, record) == text, "type: make gpu-static ARGS=--record"
    assert page.VARIANTS.read_text() == page.variants(record), "type: make gpu-static ARGS=--record"
    assert ratchet.limits(record["figures"]) == ratchet.coverage(record["figures"]) == []


@pytest.mark.parametrize(
    "registers, local, group, share",
    [(32, 0, 256, 1.0), (64, 0, 256, 0.5), (80, 0, 256, 0.375), (128, 0, 256, 0.25), (168, 0, 256, 0.125),
     (32, 0, 16, 0.5), (64, 48 * 1024, 256, 0.5), (32, 64 * 1024, 256, 0.375), (32, 0, 0, 1.0)],
)  # fmt: skip
def test_occupancy_follows_registers_local_memory_and_groups(registers, local, group, share):
    """Values of NVIDIA's occupancy calculator for compute capability 9.0."""
    assert occupancy.nvidia("sm_90", registers, local, group) == share


@pytest.mark.parametrize("target, most", [("sm_80", 32), ("sm_89", 24), ("sm_90", 32), ("sm_120", 24)])
def test_groups_of_a_warp_are_as_many_as_the_hardware_counts(target, most):
    assert occupancy.groups(target, 16, 0, 32) == most and occupancy.groups(target, 128, 0, 256) == 2
    assert occupancy.groups(target, 16, 99 * 1024, 32) == {"sm_90": 2}.get(target, 1)


def test_sizes_of_groups_that_a_kernel_requires_are_in_its_ptx(tmp_path):
    ptx = tmp_path / "all.ptx"
    text, kernel = "__kernel __attribute__((reqd_work_group_size(ITEMS, 1, 1)))", ".entry sum(\n\t.param .u64 x\n)\n{"
    for bound, wanted in ((0, kernel.replace("\n{", "\n.reqntid 64, 1, 1\n{")), (128, kernel)):
        ptx.write_text(kernel)
        compilers._require_groups(ptx, text, {"ITEMS": 64, "REGISTERS": bound})
        assert ptx.read_text() == wanted


def test_what_intels_compiler_refuses_is_named(monkeypatch, tmp_path):
    names = ("merge_subapertures.cl FP64=0", "merge_subapertures.cl FP64=1", "backproject_float64.cl VW=1")
    monkeypatch.setattr(compilers, "OCLOC", "python3")
    monkeypatch.setattr(figures_of, "cache", lambda: tmp_path)
    monkeypatch.setattr(compilers, "intel_refusal", lambda variant: built.append(variant.name) or "no such type")
    built: list[str] = []
    digests = dict.fromkeys(names, "1")
    number, (said,) = figures_of.intel(digests, {})
    assert number == 0 and "merge_subapertures.cl FP64=0 on Intel's dg2 cannot be compiled: no such type" in said
    assert figures_of.intel(digests, {"intel": 1, "digests": digests}) == (1, [])
    assert built == [names[0]]  # the others compute in float64


def test_programs_recorded_from_the_same_text_are_not_compiled_again(monkeypatch, tmp_path):
    known, changed, other = (Variant("merge_subapertures.cl", (("TAPS", taps),)) for taps in (2, 4, 6))
    use = Use(["task"], {"merge": {64}})
    monkeypatch.setattr(figures_of, "variants", lambda: dict.fromkeys((known, changed, other), use))
    monkeypatch.setattr(figures_of, "cache", lambda: tmp_path)
    monkeypatch.setattr(compilers, "versions", lambda: {"ptxas": "1"})
    monkeypatch.setattr(figures_of, "_counted", lambda variant: counted.append(variant) or {"merge": {"sm_90": {}}})
    counted: list[Variant] = []
    _, digests = figures_of.figures(lambda *_: None, {"figures": {}})
    assert sorted(counted) == sorted([known, changed, other])
    record = {"figures": {v.name: {"merge": {"group": 9, "sm_90": {"registers": 7}}} for v in (known, changed)}}
    record["digests"] = {
        known.name: digests[known.name],
        changed.name: "of another text",
        other.name: digests[other.name],
    }
    counted.clear()
    for file in tmp_path.iterdir():
        file.unlink()
    found, again = figures_of.figures(lambda *_: None, record)
    assert sorted(counted) == sorted([changed, other]) and again == digests
    assert found[known.name] == {"merge": {"group": 64, "sm_90": {"registers": 7}}}
