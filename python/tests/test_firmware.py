"""Controllers as programs for a microcontroller."""

import pickle
import re

import numpy as np
import pytest
from plants import cart_pole

import lpvmpc


def controller(**others):
    settings = {"u_bounds": {"force": (-12, 12)}, "x_bounds": {"position": (-0.75, None)}}
    return lpvmpc.Mpc(cart_pole(), 0.05, 25, [10, 10, 0.1, 0.1], [0.01], **(settings | others))


def saved(mpc, folder, **others):
    mpc.save_firmware(folder, lpvmpc="/where/lpvmpc/is", x0=[0, 0.3, 0, 0], **others)
    return (folder / "src" / "main.rs").read_text()


def terminal_cost(text):
    rows = re.search(r"Cost\(SMatrix::from\(\[(.*?)\]\)\)", text, re.S).group(1)
    return np.array(re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", rows), dtype=float).reshape(4, 4)


def test_the_terminal_cost_of_a_program_is_that_of_the_controller(tmp_path):
    """After other parameters it was another one, designed for them."""
    mpc = controller()
    before = terminal_cost(saved(mpc, tmp_path / "before"))
    mpc.set_parameters(pole_mass=0.375)
    kept = terminal_cost(saved(mpc, tmp_path / "kept"))
    copied = terminal_cost(saved(pickle.loads(pickle.dumps(mpc)), tmp_path / "copied"))
    np.testing.assert_array_equal(kept, before)
    np.testing.assert_array_equal(copied, before)
    mpc.set(q=[10, 10, 0.1, 0.1])  # designs anew
    anew = terminal_cost(saved(mpc, tmp_path / "anew"))
    p = lpvmpc.lqr(mpc.plant, 0.05, [10, 10, 0.1, 0.1], [0.01]).p
    np.testing.assert_allclose(anew, p, rtol=1e-6)
    assert abs(anew - before).max() > 1e-3
    mpc.set(terminal=2 * p)
    np.testing.assert_allclose(terminal_cost(saved(mpc, tmp_path / "given")), 2 * p, rtol=1e-6)


def test_a_program_has_the_controllers_numbers(tmp_path):
    mpc = controller()
    mpc.set_parameters(pole_mass=0.375)
    text = saved(mpc, tmp_path / "robot", x_ref=[0.5, 0, 0, 0], samples=40)
    p = lpvmpc.lqr(cart_pole(), 0.05, [10, 10, 0.1, 0.1], [0.01]).p  # as before the parameters changed
    np.testing.assert_allclose(terminal_cost(text), p, rtol=1e-6)
    for part in ("[12.0]", "[-12.0]", "-0.75", "usize = 25", "usize = 40", "[0.5, 0.0, 0.0, 0.0]"):
        assert part in text, part
    assert "/where/lpvmpc/is" in (tmp_path / "robot" / "Cargo.toml").read_text()
    assert "0.375" in (tmp_path / "robot" / "src" / "plant.rs").read_text()
    with pytest.raises(lpvmpc.PlantError, match="robot"):
        saved(mpc, tmp_path / "robot")  # nothing is overwritten


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"substeps": 2}, "substeps: on a microcontroller it must be 1"),
        ({"method": "fixed"}, "method"),
        ({"state_bounds": "hard"}, "state_bounds"),
        ({"q": np.ones((4, 4)) + 20 * np.eye(4)}, "q: on a microcontroller it must be diagonal"),
        ({"terminal": "equality"}, "terminal"),
        ({"rows": [lpvmpc.Row("sum", x={"tilt": 1.0}, upper=1.0)]}, "rows"),
        ({"estimator": lpvmpc.Estimator({"position": 1e-6, "tilt": 1e-6}, 1e-3)}, "estimator"),
    ],
)
def test_what_a_program_has_not_is_refused(tmp_path, change, said):
    mpc = controller()
    mpc.set(**change)
    with pytest.raises(lpvmpc.SettingError, match=said):
        saved(mpc, tmp_path / "robot")
    assert not (tmp_path / "robot").exists()
