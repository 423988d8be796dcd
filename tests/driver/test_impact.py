"""Impacts: shapes, units, relations between the arrays, errors."""

from __future__ import annotations

import sysconfig
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from conftest import python

import thud
from thud.impact.contact_time import contact_span
from thud.level.levels import peak_count


def test_forces_add_up(shell: thud.Impact) -> None:
    components = shell.components
    elastic = components["shell_force"] + components["gas_force"]
    assert np.allclose(shell.elastic_force, elastic, rtol=1e-15)
    assert np.allclose(shell.floor_force, elastic + components["flux_force"], rtol=1e-15)
    assert shell.peak_elastic_force == pytest.approx(shell.elastic_force.max(), rel=1e-5)
    assert shell.peak_elastic_force >= shell.elastic_force.max()


def test_force_is_zero_after_release(shell: thud.Impact) -> None:
    after = shell.time > shell.contact_time
    assert after.any()
    assert not shell.floor_force[after].any()
    assert (shell.floor_force[~after] > 0).all()


def test_impulse_changes_the_momentum() -> None:
    ball = thud.Ball(mass=2.4)
    impact = thud.solve(ball, thud.Drop(0.5), model="hollow_sphere")
    momentum = ball.mass * impact.impact_velocity * (1 + impact.restitution)
    # The sum of the samples misses half of the last, partial interval: slope times its square.
    assert impact.floor_force.sum() / 44100 == pytest.approx(momentum, abs=1e-4)
    assert impact.impulse == pytest.approx(momentum, rel=1e-12)


def test_paper_s_ball_does_not_conform() -> None:
    verdict = thud.solve(model="hollow_sphere").assess()
    assert not verdict
    missed = [criterion.name for criterion in verdict.criteria if not criterion]
    assert missed == ["octave_125", "octave_250", "octave_500"]
    assert verdict.criteria[-1].name == "drop_height"
    assert not thud.solve(drop=thud.Drop(0.1), model="hollow_sphere").assess().criteria[-1]


def test_threads_do_not_disturb_each_other() -> None:
    # Some fail: errors are made of text, which compilers do not always keep apart.
    heights = np.concatenate([np.linspace(0.1, 2.0, 40), np.linspace(-2, 0, 40), [1e3, 2e3] * 20])

    def levels(height: float) -> list[float] | str:
        try:
            impact = thud.solve(drop=thud.Drop(float(height)), model="hollow_sphere")
        except thud.ThudError as error:
            return str(error)
        return [*impact.levels(), *impact.levels("third", "fft", "floor")]

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(levels, heights)) == list(map(levels, heights))


def test_interpreters_without_a_lock_stay_so() -> None:
    code = "import sys, thud; thud.solve(); print(getattr(sys, '_is_gil_enabled', lambda: True)())"
    done = python("-W", "error", "-c", code)
    has_lock = not sysconfig.get_config_var("Py_GIL_DISABLED")
    assert done.stdout.strip() == str(has_lock), done.stderr


def test_each_question_is_answered_for_the_force_that_is_asked() -> None:
    case = thud.Case(
        model=thud.HollowSphere(), levels=thud.Levels(force="elastic", method="fft"),
        limits=thud.Limits("tyre"), ball=thud.Ball(mass=2.4), drop=thud.Drop(0.9),
    )  # fmt: skip
    impact = replace(thud.solve(case), peak_elastic_force=1.0, peak_force=2.0)
    rate = impact.sample_rate
    peaks = {"elastic": 1.0, "floor": 2.0}
    forces = {"elastic": impact.elastic_force, "floor": impact.floor_force}
    for asked, judged in ((None, "elastic"), ("elastic", "elastic"), ("floor", "floor")):
        assert impact.assessed_force(asked) == judged  # type: ignore[arg-type]
        assert impact.force(asked) is forces[judged]  # type: ignore[arg-type]
        assert impact.peak(asked) == peaks[judged]  # type: ignore[arg-type]
        for method in (None, "exact", "fft"):
            levels = thud.force_exposure_levels(forces[judged], rate, "third", method or "fft")  # type: ignore[arg-type]
            assert (impact.levels("third", method, asked) == levels).all()  # type: ignore[arg-type]
        for source in (None, "rubber_ball", "tyre"):
            expected = thud.assess_levels(
                impact.levels(force=asked), impact.contact_time, impact.restitution,  # type: ignore[arg-type]
                peak_count(forces[judged], rate), 2.4, 0.9, source or "tyre",  # type: ignore[arg-type]
            )  # fmt: skip
            found = impact.assess(source, asked)  # type: ignore[arg-type]
            # The numerical error is that of the impact.
            for one, other in zip(found.criteria, expected.criteria, strict=True):
                assert (one.name, one.value, one.lower, one.upper, one.conforms) == (
                    other.name, other.value, other.lower, other.upper, other.conforms,
                )  # fmt: skip


def test_arguments_of_a_drop_are_keys_of_its_case() -> None:
    ball, drop = thud.Ball(mass=2.4), thud.Drop(0.9)
    impact = thud.solve(
        ball, drop, sample_rate=48000.0, duration=0.04, substeps=9, model="hollow_sphere"
    )
    assert impact.case.sampling == thud.Sampling(48000.0, 0.04, 9)
    assert (impact.case.ball, impact.case.drop) == (ball, drop)
    assert impact.time[1] == 1 / 48000
    for array in (impact.time, *impact.histories().values()):
        assert (array.shape, array.dtype) == ((1920,), np.float64)
    default = thud.solve(model="hollow_sphere")
    assert default.case == thud.Case(model=thud.HollowSphere())
    # Free modes and compression of a case have functions of their own.
    more = replace(default.case, modes=thud.Modes(), compression=thud.Compression())
    found = thud.solve(more)
    assert found.case == more
    assert (found.floor_force == default.floor_force).all()


def test_contact_time_as_recorded_is_the_span_around_the_contact(shell: thud.Impact) -> None:
    # Up to the first sample after release.
    force = np.append(np.trim_zeros(shell.floor_force, "b"), 0.0)
    begin, end = contact_span(force, shell.sample_rate)
    assert shell.contact_time_as_recorded == pytest.approx(end - begin, abs=1e-12)
    # Later touch, and a second contact, make no difference.
    shift = 500
    moved = np.concatenate([np.zeros(shift), shell.floor_force, shell.floor_force])
    later = replace(shell, floor_force=moved, touch_time=shift / shell.sample_rate)
    assert later.contact_time_as_recorded == pytest.approx(shell.contact_time_as_recorded, abs=1e-9)
