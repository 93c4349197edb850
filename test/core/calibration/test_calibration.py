# Copyright 2026 flea_diag maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

from __future__ import annotations

import copy
import math

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support import examples, stands
from support.places import WING

from flea_diag.configuration import calibrations, files, knowledge
from flea_diag.configuration.stand import load_stand, shipped_stands
from flea_diag.core.calibration.calibration import BadStretch
from flea_diag.core.calibration.calibration_reader import LATER, from_mapping
from flea_diag.core.observers.observer_noise import ObserverNoise
from flea_diag.errors import CalibrationError, ConfigurationError, InputError
from flea_diag.tools.calibrate import calibrate as tool


def mapping() -> dict:
    return copy.deepcopy(stands.calibration().to_mapping())


def test_a_file_gives_back_what_was_written(tmp_path):
    path = tmp_path / "new" / "calibration.yaml"
    tool.write_calibration(path, stands.calibration())
    found = calibrations.load_calibration(path)
    assert found == stands.calibration()
    assert calibrations.calibration_sha256(found) == calibrations.calibration_sha256(
        stands.calibration()
    )
    assert not list(path.parent.glob("*.part"))
    assert found.limit("parity_mechanical").windows[0].window == 50
    assert found.limit("nothing") is None


def test_bad_stretches_survive_the_round_trip():
    plain = mapping()
    plain["bad_stretches"] = [
        {"run": "a", "channel": "motor_voltage", "start_s": 1.0, "end_s": 2.5}
    ]
    assert from_mapping(plain, "here").bad_stretches == (
        BadStretch("a", "motor_voltage", 1.0, 2.5),
    )


def put(path: tuple, value: object):
    def damage(plain: dict) -> None:
        place = plain
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value

    return damage


BOMB: list = ["x"]
for _ in range(60):
    BOMB = [BOMB, BOMB]

DAMAGE = {
    "wrong schema": (put(("schema_version",), 3), "schema_version = 3"),
    "schema a bomb": (put(("schema_version",), BOMB), "schema_version = "),
    "other regions": (put(("speed_regions_m_s",), [0.1, 0.2]), "speed_regions_m_s"),
    "regions a number": (put(("speed_regions_m_s",), 5), "speed_regions_m_s"),
    "unknown entry": (put(("voltage_limit",), 8.0), "unknown key 'voltage_limit'"),
    "text for a number": (put(("period_s",), "0.01"), "period_s = '0.01' must be a number"),
    "true for a number": (put(("period_s",), True), "period_s = True must be a number"),
    "not positive": (put(("nominal_s",), 0.0), "nominal_s = 0.0 must be above 0"),
    "not a number": (put(("voltage_limit_v",), math.nan), "voltage_limit_v = nan must be a finite"),
    "infinite": (
        put(("parameters", "reflected_mass_kg"), math.inf),
        "parameters: reflected_mass_kg = inf must",
    ),
    "too large an integer": (put(("period_s",), 10**400), "period_s"),
    "text a bomb": (put(("actuator",), BOMB), "actuator = .* must be text"),
    "number a bomb": (put(("period_s",), BOMB), "period_s = .* must be a number"),
    "number for a text": (put(("actuator",), 7), "actuator = 7 must be text"),
    "text for a list": (put(("channels",), "motor_current"), "channels"),
    "unknown parameter": (
        put(("parameters", "mass"), 1.0),
        "parameters: unknown key 'mass', known",
    ),
    "parameters a list": (put(("parameters",), [1.0]), "parameters"),
    "limit without k": (
        lambda m: m["limits"][0]["windows"][0].pop("k"),
        r"limits\[0\]: windows\[0\]: k is missing",
    ),
    "regions lacking": (
        put(("limits", 0, "windows", 0, "sigma"), [1.0]),
        "limits: .*window 50: sigma needs 3 speed regions, has 1",
    ),
    "sigma not positive": (put(("limits", 0, "windows", 0, "sigma"), [1.0, 0.0, 1.0]), "limits"),
    "unknown window": (
        put(("limits", 0, "windows", 0, "window"), 77),
        r"limits: .*windows \[77.*known \(50, 100",
    ),
    "unknown shift": (
        put(("shifts", 0, "window"), 17),
        r"shifts: .*window = 17, choose one of \(200, 400",
    ),
    "no period": (put(("counted_period_s",), 0.0), "counted_period_s = 0.0 is below its limit"),
    "half a window": (put(("limits", 0, "windows", 0, "window"), 0.5), "limits"),
    "scatter lacking": (put(("limits", 0, "sigma"), []), "limits"),
    "limits a number": (put(("limits",), 3), "limits"),
    "stretch a text": (put(("bad_stretches",), ["all"]), "bad_stretches"),
    "no cooling": (put(("parameters", "motor_cooling_s"), 0.0), "motor_cooling_s"),
    "negative mass": (put(("parameters", "reflected_mass_kg"), -5.0), "reflected_mass_kg"),
    "negative error": (
        put(("sigmas", "coulomb_friction_n"), -0.5),
        "sigmas: coulomb_friction_n = -0.5 is below its limit 0.0",
    ),
    "negative variance": (put(("covariance", 0, "matrix", 0, 0), -1.0), "variance -1.0 is below"),
    "a scan in decades": (
        put(("period_s",), 1.0e9),
        "period_s = 1000000000.0 is above its limit 1.0",
    ),
    "a scan in no time": (
        put(("period_s",), 1.0e-12),
        "period_s = 1e-12 is below its limit 0.0001",
    ),
    "cools at once": (put(("parameters", "motor_cooling_s"), 1.0e-15), "motor_cooling_s = 1e-15"),
    "nut cools at once": (
        put(("parameters", "nut_cooling_s"), 1.0e-3),
        "nut_cooling_s = 0.001 is below its limit 1.0",
    ),
    "no inertia": (put(("parameters", "reflected_mass_kg"), 5e-324), "reflected_mass_kg = 5e-324"),
    "no resistance": (
        put(("parameters", "winding_resistance_ohm"), 1e-9),
        "winding_resistance_ohm",
    ),
    "sharp friction": (put(("parameters", "stribeck_speed_m_s"), 1e-300), "stribeck_speed_m_s = 1"),
    "beyond any unit": (
        put(("parameters", "coulomb_friction_n"), 1e300),
        "coulomb_friction_n = 1e.300 lies outside 1e-60 to 1e.15; check its unit",
    ),
    "noise of nothing": (
        put(("observer_noise", "force_n"), 1e-300),
        "force_n = 1e-300 lies outside 1e-60",
    ),
    "one alarm in an eternity": (
        put(("false_alarms_per_hour",), 1e-99),
        "false_alarms_per_hour = 1e-99 lies outside 1e-60",
    ),
    "digits": (
        put(("sigmas", "coulomb_friction_n"), 10**5000),
        "some 5000 digits must be a finite number",
    ),
    "no channel": (put(("channels",), []), "channels is empty: nothing was calibrated"),
    "no gain": (put(("parameters", "drive_gain"), 0.0), "drive_gain = 0.0 must be above 0"),
    "the least number that there is": (
        put(("parameters", "encoder_m_per_rad"), 5e-324),
        "encoder_m_per_rad = 5e-324 lies outside 1e-60 to 1e.15; check its unit",
    ),
    "an empty range": (
        put(("envelope",), {"position": "", "relations": [], "ranges": {"load_force": [3.0, 1.0]}}),
        "envelope: ranges: 'load_force' from 3.0 to 1.0 holds nothing",
    ),
    "no square": (
        put(
            ("envelope",),
            {
                "position": "",
                "ranges": {},
                "relations": [
                    {"relation": "place", "root": [[1.0], [1.0, 2.0]], "reach": 1.0, "most": 1.0}
                ],
            },
        ),
        "envelope: relations: 'place': root is not square",
    ),
    "no tolerance": (put(("tolerance", "coulomb_friction_n"), 0.0), "coulomb_friction_n"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_damage_is_refused_by_name(kind):
    damage, words = DAMAGE[kind]
    plain = mapping()
    damage(plain)
    with pytest.raises(CalibrationError, match=words) as refusal:
        from_mapping(plain, "cal.yaml")
    assert str(refusal.value).startswith("cal.yaml: ")
    assert len(str(refusal.value)) < 1000
    assert "\n" not in str(refusal.value)


def test_an_older_file_without_the_observers_noise_has_the_default():
    plain = mapping()
    del plain["observer_noise"]
    assert from_mapping(plain, "cal.yaml").observer_noise == ObserverNoise()


def test_entries_that_older_files_had_are_passed_over():
    plain = mapping()
    plain["tolerance"]["noise_log"] = 0.35
    for limit in plain["limits"]:
        limit["nominal"] = 1.0
    assert from_mapping(plain, "cal.yaml") == from_mapping(mapping(), "cal.yaml")


@pytest.mark.parametrize("stand", sorted(shipped_stands()))
def test_the_shipped_calibrations_are_read_with_what_older_ones_have_in_their_rows(stand):
    path = load_stand(stand).calibration
    plain = yaml.load(path.read_text(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    for row in plain.get("envelope", {}).get("relations", []):
        row["discrepancy"] = 0.1
    assert from_mapping(plain, "here") == calibrations.load_calibration(path)


def test_a_missing_entry_is_named():
    needed = [key for key in mapping() if key not in LATER]
    assert len(needed) > 5
    for key in needed:
        plain = mapping()
        del plain[key]
        with pytest.raises(CalibrationError, match=key):
            from_mapping(plain, "cal.yaml")


@pytest.mark.parametrize("content", [None, [], "text", 5])
def test_what_is_no_mapping_is_refused(content):
    with pytest.raises(CalibrationError, match=r"^cal\.yaml: calibration must be a mapping, not "):
        from_mapping(content, "cal.yaml")


JUNK = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**400), 10**400)
    | st.floats()
    | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=6,
)


@pytest.mark.slow
@settings(max_examples=examples(150), deadline=None)
@given(st.deferred(lambda: st.sampled_from(sorted(mapping()))), JUNK)
def test_junk_anywhere_is_refused_or_read_never_a_traceback(key, junk):
    plain = mapping()
    plain[key] = junk
    try:
        found = from_mapping(plain, "cal.yaml")
    except CalibrationError:
        return
    assert found.to_mapping() == plain


HOSTILE = {
    "tab": "a:\tb: {",
    "python": "!!python/object/apply:os.system ['true']",
    "deep": "[" * 5000,
    "date": "a: 2001-99-99",
    "integer": "a: !!int 'x'",
    "float": "a: !!float 'x'",
    "boolean": "a: !!bool 'x'",
    "timestamp": "a: !!timestamp 'x'",
    "digits": "a: " + "9" * 5000,
    "unhashable": "? [a]\n: b",
    "two documents": "a: 1\n---\nb: 2",
    "bytes": "a: \x00",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_yaml_ends_in_one_line(kind, tmp_path):
    path = tmp_path / "c.yaml"
    path.write_text(HOSTILE[kind])
    with pytest.raises(InputError) as refusal:
        calibrations.load_calibration(path)
    assert str(path) in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_files_that_cannot_be_read_are_named(tmp_path):
    large, foreign = tmp_path / "large.yaml", tmp_path / "foreign.yaml"
    large.write_bytes(b"#" * (files.LARGEST_YAML_BYTES + 1))
    foreign.write_bytes(b"a: \xff\xfe")
    for path, words in (
        (large, f"{files.LARGEST_YAML_BYTES + 1} bytes, above the limit"),
        (foreign, "not a text file"),
        (tmp_path / "none.yaml", "no such file"),
        (tmp_path, "no such"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            files.load_yaml(path)
    with pytest.raises(ConfigurationError, match=r"nowhere\.yaml: no such configuration file"):
        files.load_yaml("nowhere.yaml")


def test_aliases_are_not_multiplied_out(tmp_path):
    path = tmp_path / "c.yaml"
    lines = ["a0: &a0 [x, x]"] + [f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]" for n in range(1, 60)]
    path.write_text("\n".join([*lines, "schema_version: *a59"]))
    with pytest.raises(ConfigurationError, match="more than 100000 values, with its aliases"):
        calibrations.load_calibration(path)


def test_the_digest_is_of_the_content_and_not_of_the_layout(tmp_path):
    one, two = tmp_path / "1.yaml", tmp_path / "2.yaml"
    one.write_text(yaml.safe_dump(mapping(), sort_keys=True))
    two.write_text(yaml.safe_dump(mapping(), default_flow_style=True, sort_keys=False))
    assert len({calibrations.calibration_sha256(calibrations.load_calibration(p))
                for p in (one, two)}) == 1  # fmt: skip
    changed = mapping()
    changed["parameters"]["coulomb_friction_n"] = float(
        np.nextafter(changed["parameters"]["coulomb_friction_n"], 1e9)
    )
    assert calibrations.calibration_sha256(
        from_mapping(changed, "")
    ) != calibrations.calibration_sha256(stands.calibration())


def test_a_calibration_of_another_actuator_is_refused_by_both_names():
    with pytest.raises(
        CalibrationError, match=r"for actuator 'flea' .*wing/actuator\.yaml describes 'wing'"
    ):
        knowledge.knowledge(load_stand(actuator=WING), stands.calibration())
