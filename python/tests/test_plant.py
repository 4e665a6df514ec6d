"""Plants from everywhere have the values of the program that they come from."""

import copy
import json
import pickle
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pandas as pd
import pytest
import sympy as sp

import lpvmpc
from lpvmpc._files import save
from plants import cart_pole, cart_pole_formulas, hovering


A_X, A_U, M = sp.symbols("a_x a_u m")


def points(n, m, count=30):
    rng = np.random.default_rng(5)
    return [(rng.uniform(-2, 2, n), rng.uniform(-3, 3, m)) for _ in range(count)]


def agree(plant, x, u, f, p=(), values=(), tolerance=1e-12):
    """The plant's f and its Jacobian are CasADi's."""
    arguments = [x, u, *p]
    reference = ca.Function("r", arguments, [f, ca.jacobian(f, x), ca.jacobian(f, u)])
    for at, under in points(x.numel(), u.numel()):
        rate, a, b = (np.array(one) for one in reference(at, under, *values))
        np.testing.assert_allclose(plant.f(at, under), rate.ravel(), rtol=tolerance, atol=tolerance)
        found_a, found_b = plant.jacobian(at, under)
        np.testing.assert_allclose(found_a, a, rtol=tolerance, atol=tolerance)
        np.testing.assert_allclose(found_b, b, rtol=tolerance, atol=tolerance)


def test_of_casadi():
    x, u, p, f, values = cart_pole_formulas()
    agree(cart_pole(), x, u, f, [p], [list(values.values())])


def test_parameters_change():
    x, u, p, f, values = cart_pole_formulas()
    changed = {**values, "pole_mass": 0.55}
    plant = cart_pole()
    agree(plant.with_parameters(pole_mass=0.55), x, u, f, [p], [list(changed.values())])
    assert plant.parameters == values


def test_every_operation_of_casadi():
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u", 2)
    a, b, c = ca.vertsplit(x)
    v, w = ca.vertsplit(u)
    small = ca.tanh(a) / 2
    f = ca.vertcat(
        ca.asin(small) + ca.acos(small) - ca.atan(b * w) * ca.sinh(a) + ca.cosh(b) + ca.asinh(a)
        - ca.acosh(2 + c**2) + ca.atanh(small) * ca.tan(small) + ca.exp(a / 3) + ca.sin(a) / a,
        ca.log(2 + c**2) + (1 + a**2) ** b + (2 + b**2) ** -1.3 + c**3 + ca.sqrt(1 + v**2)
        + ca.atan2(b, c) + ca.expm1(a) - ca.log1p(b**2) + ca.hypot(v, w) + 1 / (3 + w**2) + 2 * a,
        ca.fabs(a) + ca.sign(b) * c - ca.fmin(a, b) * ca.fmax(v, c) + ca.floor(w) + ca.ceil(v)
        + ca.if_else(a < b, ca.sin(v), c**2) + ca.if_else(ca.logic_and(a <= c, v != w), v, b)
        + ca.if_else(ca.logic_or(ca.logic_not(a < v), b <= w), 1, -c),
    )  # fmt: skip
    agree(lpvmpc.Plant.from_casadi(x, u, f), x, u, f, tolerance=1e-11)


def test_truth_is_what_is_not_zero():
    x, u = ca.SX.sym("x"), ca.SX.sym("u")
    f = ca.if_else(ca.logic_or(-x, u), 2, 3) + ca.if_else(ca.logic_and(x, u), 5, 7)
    plant = lpvmpc.Plant.from_casadi(x, u, f)
    reference = ca.Function("f", [x, u], [f])
    for at in (-2.0, 0.0, 1.0):
        for under in (-0.5, 0.0):
            assert plant.f([at], [under])[0] == float(reference(at, under))


@pytest.mark.parametrize("symbols", [ca.SX, ca.MX])
def test_of_lists_of_symbols(symbols):
    position, speed, force = (symbols.sym(name) for name in ("position", "speed", "force"))
    plant = lpvmpc.Plant.from_casadi([position, speed], [force], [speed, force - position**3])
    assert [one.name for one in plant.states] == ["position", "speed"]
    assert plant.f([2, 3], [1]).tolist() == [3.0, -7.0]


def test_of_a_function_of_matrices():
    x, u = ca.MX.sym("x", 4), ca.MX.sym("u", 2)
    a = np.arange(16.0).reshape(4, 4)
    f = a @ ca.sin(x) + ca.vertcat(u, ca.dot(x, x), ca.norm_2(x))
    plant = lpvmpc.Plant.from_casadi(x, u, f)
    agree(plant, x, u, f, tolerance=1e-11)
    assert [one.name for one in plant.states] == ["x_0", "x_1", "x_2", "x_3"]


def test_of_do_mpc_s_model():
    """Any object with what a Model has after its setup()."""

    class Structure:
        def __init__(self, **parts):
            self.parts = parts
            self.cat = ca.vertcat(*parts.values()) if parts else ca.SX(0, 1)

        def keys(self):
            return self.parts.keys()

        def __getitem__(self, key):
            return self.parts[key]

    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    mass, wind = ca.SX.sym("mass"), ca.SX.sym("wind")
    empty = ca.SX(0, 1)
    model = SimpleNamespace(
        flags={"setup": True},
        model_type="continuous",
        n_z=0,
        _x=Structure(x=x),
        _u=Structure(default=empty, thrust=u),
        _p=Structure(default=empty, mass=mass),
        _tvp=Structure(default=empty, wind=wind),
        _rhs=Structure(x=ca.vertcat(x[1], u / mass + wind)),
    )
    plant = lpvmpc.Plant.from_do_mpc(model, parameters={"wind": 0.5, "mass": 2.0})
    assert plant.parameters == {"mass": 2.0, "wind": 0.5}
    assert [one.name for one in (*plant.states, *plant.inputs)] == ["x_0", "x_1", "thrust"]
    assert plant.f([0, 3], [4]).tolist() == [3.0, 2.5]
    model.flags = {"setup": False}
    with pytest.raises(lpvmpc.PlantError, match="setup"):
        lpvmpc.Plant.from_do_mpc(model)


def test_of_acados_model():
    x, u = ca.SX.sym("x", 2), ca.SX.sym("u")
    model = SimpleNamespace(
        x=x, u=u, p=[], z=None, f_expl_expr=ca.vertcat(x[1], u), name="cart", x_labels=["s", "v"]
    )
    plant = lpvmpc.Plant.from_acados(model)
    assert (plant.name, plant.states[1].name) == ("cart", "v")
    assert plant.f([1, 2], [3]).tolist() == [2.0, 3.0]
    model.f_expl_expr = None
    with pytest.raises(lpvmpc.PlantError, match="f_expl_expr"):
        lpvmpc.Plant.from_acados(model)


def test_of_sympy():
    a, b, v, m, g = sp.symbols("a b v m g")
    f = [
        b / m + sp.sin(a) / a + sp.sqrt(1 + a**2) * sp.exp(-b) + sp.Rational(1, 3) * a**3,
        g * sp.sin(a) ** 2 - v / (m + a**2) + sp.atan2(b, a) + sp.Abs(b) ** sp.Rational(3, 2)
        + sp.Max(a, b, v) - sp.Min(a, v) + sp.Piecewise((a, a < b), (b**2, a > 1), (v, True))
        + sp.pi * sp.cosh(a) + sp.sign(a) * sp.floor(b),
    ]  # fmt: skip
    plant = lpvmpc.Plant.from_sympy([a, b], [v], f, y=[a * b], parameters={m: 2.0, g: 9.81})
    exact = sp.lambdify([a, b, v, m, g], f, modules=[{"atan2": np.arctan2}, "numpy"])
    for at, under in points(2, 1):
        expected = exact(*at, *under, 2.0, 9.81)
        np.testing.assert_allclose(plant.f(at, under), expected, rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(plant.g(at, under), [at[0] * at[1]])
    assert plant.parameters == {"m": 2.0, "g": 9.81}
    assert pieces((A_X, A_X > 0), (-A_X, A_X <= 0)).f([-4.0], [0.0]) == [1 + np.sin(4.0)]
    with pytest.raises(lpvmpc.PlantError, match="m is neither a state"):
        lpvmpc.Plant.from_sympy([a, b], [v], f, parameters={g: 9.81})


@pytest.mark.parametrize(
    ("formula", "at", "value"),
    [
        # The exponential is 0, and the one in the common denominator was infinite.
        (A_U - A_X * (1 + 0.5 * sp.exp(-((A_X / 0.01) ** 2))), 0.3, -0.3),
        (A_U + 2 / (1 + sp.exp(-100 * A_X)), 8.0, 2.0),
        (-3 * A_X / (2 * sp.sqrt(A_X) * (A_X - 2) ** 2), 4.0, -0.75),
        (-1 / (A_X * (A_X + 1)), 1.0, -0.5),
    ],
)
def test_fractions_of_sympy_stay_as_they_are_written(formula, at, value):
    """They were NaN where the numerator and the denominator that SymPy makes of them are both infinite."""
    assert lpvmpc.Plant.from_sympy([A_X], [A_U], [formula]).f([at], [0.0])[0] == pytest.approx(value, rel=1e-15)


def test_conditions_of_sympy_may_occur_twice():
    """What SymPy has in place of the second one had no counterpart."""
    both = sp.And(A_X > 0, A_U < 1)
    f = [
        sp.Piecewise((A_X, A_X > 0), (0, True)) * A_U + sp.Piecewise((1, A_X > 0), (2, True)),
        sp.Piecewise((A_U, both), (A_X, True)) - sp.Piecewise((3, both), (4, A_X <= 0), (5, sp.Or(A_X > 0, both)), (6, True)),
    ]  # fmt: skip
    plant = lpvmpc.Plant.from_sympy([A_X, M], [A_U], f)
    for (x, m), (u,) in points(2, 1):
        first = (x * u if x > 0 else 0) + (1 if x > 0 else 2)
        second = (u - 3 if u < 1 else x - 5) if x > 0 else x - 4
        assert plant.f([x, m], [u]).tolist() == pytest.approx([first, second], rel=1e-15)


def test_of_matrices():
    rng = np.random.default_rng(1)
    a, b, c, d = (rng.normal(size=shape) for shape in ((3, 3), (3, 2), (2, 3), (2, 2)))
    plant = lpvmpc.Plant.from_matrices(a, b, c, d, offset=[1, 2, 3])
    for x, u in points(3, 2, 5):
        np.testing.assert_allclose(plant.f(x, u), a @ x + b @ u + [1, 2, 3], rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(plant.g(x, u), c @ x + d @ u, rtol=1e-13, atol=1e-13)


def rod(parameters):
    """A rod of a mass and a length, symbols with these names."""
    mass, length = ca.SX.sym("mass"), ca.SX.sym("length")
    f = ca.vertcat(X[1], 9.81 / length * ca.sin(X[0]) + U / (mass * length**2))
    return lpvmpc.Plant.from_casadi(X, U, f, p=[mass, length], parameters=parameters)


def test_parameters_are_found_by_their_names():
    by_name = rod({"length": 0.5, "mass": 2.0})
    assert by_name == rod({"mass": 2.0, "length": 0.5}) == rod(np.array([2.0, 0.5]))
    assert by_name.parameters == {"mass": 2.0, "length": 0.5}
    assert by_name.f([0, 0], [1.0]).tolist() == [0.0, 2.0]
    # Other names are what they are to be called.
    renamed = rod({"m": 2.0, "l": 0.5})
    assert renamed.parameters == {"m": 2.0, "l": 0.5}
    assert renamed.f([0, 0], [1.0]).tolist() == [0.0, 2.0]


def test_parameters_of_pandas_are_found_by_their_names():
    """They were taken by their order."""
    assert rod(pd.Series({"length": 0.5, "mass": 2.0})).parameters == {"mass": 2.0, "length": 0.5}
    assert rod(pd.Series([2.0, 0.5])).parameters == {"mass": 2.0, "length": 0.5}
    with pytest.raises(lpvmpc.PlantError, match="p has mass, length, and no long"):
        rod(pd.Series({"mass": 2, "long": 0.5}))


def test_files_and_pickles_hold_the_same_plant(tmp_path):
    plant = cart_pole()
    plant.save(tmp_path / "plant.json")
    assert lpvmpc.Plant.load(tmp_path / "plant.json") == plant
    other = plant.with_parameters(pole_mass=0.4)
    other.save(tmp_path / "plant.json", overwrite=True)
    assert lpvmpc.Plant.load(tmp_path / "plant.json") == other != plant
    with pytest.raises(FileExistsError):
        plant.save(tmp_path / "plant.json")
    with pytest.raises(UnicodeEncodeError):
        save("\ud800", tmp_path / "plant.json", overwrite=True)
    with pytest.raises(UnicodeEncodeError):
        save("\ud800", tmp_path / "new.json", overwrite=False)
    # What could not be written whole has changed nothing.
    assert [file.name for file in tmp_path.iterdir()] == ["plant.json"]
    assert lpvmpc.Plant.load(tmp_path / "plant.json") == other
    again = pickle.loads(pickle.dumps(other))
    assert again == other and again != plant and hash(again) == hash(other)
    assert (again.f([0, 1, 0, 0], [1]) == other.f([0, 1, 0, 0], [1])).all()


def test_an_equilibrium_goes_along_with_the_parameters():
    """It stayed as it was, and files and copies of such a plant could not be read."""
    given = hovering()
    heavier = given.with_parameters(m=1.1)
    x, u = heavier.equilibrium
    assert x.tolist() == [2, 0] and u == pytest.approx([1.1 * 9.81], rel=1e-15)
    for again in (lpvmpc.Plant.from_json(heavier.to_json()), pickle.loads(pickle.dumps(heavier)), copy.deepcopy(heavier)):
        assert again == heavier and hash(again) == hash(heavier)
        assert again.equilibrium[1] == u and again.f([1, 2], [3]).tolist() == heavier.f([1, 2], [3]).tolist()
    assert lpvmpc.lqr(heavier, 0.1, [1, 1], [1]).u == u
    # Copies find their way back to the last bit, and there may be none within the bounds.
    for back in (heavier, pickle.loads(pickle.dumps(heavier))):
        assert back.with_parameters(m=1.0) == given
    too_heavy = given.with_parameters(m=3.0)
    assert too_heavy.equilibrium is None
    assert pickle.loads(pickle.dumps(too_heavy)) == lpvmpc.Plant.from_json(too_heavy.to_json()) == too_heavy


def test_what_a_plant_says_of_itself():
    plant = cart_pole()
    assert plant.inputs == [lpvmpc.Signal("force", "N", -15.0, 15.0)]
    assert plant.states[0] == lpvmpc.Signal("position", "m")
    assert [one.name for one in plant.outputs] == ["tip_position", "tip_height"]
    x, u = plant.equilibrium
    assert (x == 0).all() and (u == 0).all()
    assert "position [m]" in repr(plant)
    assert "impl" in plant.to_rust()


X, U = ca.SX.sym("x", 2), ca.SX.sym("u")
F = ca.vertcat(X[1], U)


def pieces(*given):
    """Where none of the conditions held, it was 0."""
    return lpvmpc.Plant.from_sympy([A_X], [A_U], [1 + sp.sin(sp.Piecewise(*given)) + A_U])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: lpvmpc.Plant.from_casadi(X, U, ca.SX.sym("free") * F), "free"),
        (lambda: lpvmpc.Plant.from_casadi(X + 1, U, F), "x: .* is no symbol"),
        (lambda: lpvmpc.Plant.from_casadi(3.0, U, F), "x: 3.0 is no symbol"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, X[0]), "derivative"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, states=["a"]), "not 2 names"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, states=["a", "a"]), "a"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, units={"b": "m"}), "there is no 'b'"),
        # Its bounds were put on both.
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, y=X[0], outputs=["x_0"]), r"outputs\[0\]: \"x_0\" is also the name of states"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": (1, -1)}), "1"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": 3}), r"\(lower, upper\)"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": (float("nan"), 1)}), "NaN"),
        # They were taken for none.
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": (float("inf"), None)}), "the lower one of u is inf"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": (None, -float("inf"))}), "the upper one of u is -inf"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, equilibrium=([0, 1], [0])), "equilibrium"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, equilibrium=([0], [0])), "equilibrium, x"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, parameters={"m": 1}), "parameters"),
        (lambda: rod({"mass": 2, "long": 0.5}), "p has mass, length, and no long"),
        (lambda: rod(["a", 1]), "parameters, mass: it is 'a'; it must be a number"),
        (lambda: rod(2.0), "parameters: it is 2.0; it must be a list, or values by name"),
        (lambda: lpvmpc.Plant.from_sympy([A_X], [A_U], [A_U], parameters=2.0), "parameters: 2.0 is not a dictionary"),
        (lambda: rod([np.nan, 1]), "parameters, mass: it is nan; it must be finite"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, bounds={"u": ("a", 1)}), "bounds, u, lower: it is 'a'"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F, equilibrium=[0, 0, 0]), r"it must be \(x, u\)"),
        (lambda: lpvmpc.Plant.from_matrices([[0]], [[1]], period=np.nan), "period: it is nan s; it must be a positive"),
        (lambda: lpvmpc.Plant.from_matrices([[0]], [[1]], equilibrium=([np.nan], [0])), "equilibrium, x: x_0 is nan; it must"),
        (lambda: lpvmpc.Plant.from_sympy([A_X], [A_U], [M * A_U], parameters={M: np.inf}), "parameters, m: it is inf"),
        (lambda: lpvmpc.Plant.from_matrices([[0]], [[1]], c=1), "c: it has . dimensions"),
        (lambda: cart_pole().with_parameters(cart_mass="a"), "parameters, cart_mass: it is 'a'"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, ca.vertcat(X[1], ca.fmod(U, 2))), "operation fmod"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, F * ca.inf), "not finite"),
        (lambda: lpvmpc.Plant.from_casadi(X, U, ca.vertcat(X[1], ca.erf(U))), "no counterpart"),
        (lambda: lpvmpc.Plant.from_matrices([[0, 1]], [[1]]), "square"),
        (lambda: lpvmpc.Plant.from_matrices([[np.nan]], [[1]]), "a: .* not finite"),
        (lambda: lpvmpc.Plant.from_matrices([["one"]], [[1]]), "no array of real numbers"),
        (lambda: lpvmpc.Plant.from_matrices([[1j]], [[1]]), "no array of real numbers"),
        (lambda: lpvmpc.Plant.load("nowhere.json"), "nowhere.json"),
        (lambda: cart_pole().with_parameters(mass=1), "there are cart_mass"),
        (lambda: cart_pole().with_parameters(cart_mass=float("inf")), "finite"),
        (lambda: cart_pole().f([0, 0, 0], [0]), r"x: its shape is \(3,\); it must be \(4,\)"),
        (lambda: lpvmpc.Plant.from_sympy([sp.Symbol("a")], [sp.Symbol("a")], [1]), "twice"),
        (lambda: pieces((A_X, A_X > 0)), "Piecewise.* add an otherwise branch"),
        (lambda: pieces((A_X, A_X > 0), (-A_X, A_X < 0)), "Piecewise.* add an otherwise branch"),
    ],
)
def test_what_makes_no_plant_is_refused(make, message):
    with pytest.raises(lpvmpc.PlantError, match=message):
        make()


def test_a_broken_file_is_refused_and_nothing_else_happens():
    """Thousands of damaged files: each is a plant or a PlantError."""
    rng = np.random.default_rng(11)
    text = cart_pole().to_json()
    refused = 0
    for _ in range(3000):
        damaged = list(text)
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(len(damaged)))
            kind = rng.integers(4)
            if kind == 0:
                del damaged[at:]
            elif kind == 1:
                damaged[at] = chr(rng.integers(32, 127))
            elif kind == 2:
                damaged.insert(at, str(rng.choice(["1e999", "-1", "[", "{", '"', "9" * 30, "null"])))
            else:
                end = int(rng.integers(at, min(at + 200, len(damaged)) + 1))
                damaged[at:end] = damaged[: int(rng.integers(0, 50))]
            if not damaged:
                damaged = ["x"]
        try:
            plant = lpvmpc.Plant.from_json("".join(damaged))
            if len(plant.states) == 4 and len(plant.inputs) == 1:
                plant.f([0.1, 0.2, 0.3, 0.4], [1.0])
        except lpvmpc.PlantError:
            refused += 1
    assert refused > 2000
    for hostile in ("[" * 100_000, '{"schema":' * 5000, '{"schema": 99}', "\0" * 10, ""):
        with pytest.raises(lpvmpc.PlantError):
            lpvmpc.Plant.from_json(hostile)
    with pytest.raises(lpvmpc.PlantError, match="version 2"):
        lpvmpc.Plant.from_json(text.replace('"schema":1', '"schema":2'))


def test_steady_states():
    """A chain of two leaking tanks: what flows in flows out, and a level of the second needs one of the first."""
    h, q = ca.SX.sym("h", 2), ca.SX.sym("q")
    out = 0.5 * ca.sqrt(h + 0.01)
    tanks = lpvmpc.Plant.from_casadi(h, q, ca.vertcat(q - out[0], out[0] - out[1]))
    found = tanks.steady_state([0.0, 1.5], weights=[0, 1])
    # The first level counts a millionth.
    np.testing.assert_allclose(found.x, [1.5, 1.5], rtol=2e-6)
    np.testing.assert_allclose(found.u, [0.5 * np.sqrt(1.51)], rtol=2e-6)
    assert not found.reached and tanks.steady_state([1.5, 1.5]).reached
    with pytest.raises(lpvmpc.SettingError, match="weights: h_0 is -1"):
        tanks.steady_state([0, 1], weights=[-1, 1])
    runaway = lpvmpc.Plant.from_casadi(h, q, ca.vertcat(1 + q**2, h[0]))
    with pytest.raises(lpvmpc.SettingError, match="no steady state"):
        runaway.steady_state([0, 0])


def test_an_embedding_of_its_own():
    x, u, s, p = ca.SX.sym("x", 2), ca.SX.sym("u"), ca.SX.sym("s"), ca.SX.sym("p")
    f = ca.vertcat(x[1], p * ca.sin(x[0]) + u)
    a = ca.blockcat([[0, 1], [p * (ca.sin(s) / s), 0]])
    b = ca.SX([0, 1])

    def plant(**changes):
        own = lpvmpc.Embedding(**{"s": s, "sigma": x[0], "a": a, "b": b, **changes})
        return lpvmpc.Plant.from_casadi(
            x, u, f, p=p, parameters={"gravity": 9.81}, inputs=["torque"], embedding=own,
            equilibrium=([0, 0], [0]),
        )  # fmt: skip

    found = json.loads(plant().to_json())["embedding"]
    assert len(found["scheduling"]) == 1 and len(found["a"]) == 2 and len(found["b"][0]) == 1
    plans = [
        lpvmpc.Mpc(plant(), 0.05, 20, [1, 1], [0.1], linear_models=models, tolerance=1e-12,
                   max_programs=50).step([0.7, 0.0])
        for models in ("own", "motion")
    ]  # fmt: skip
    np.testing.assert_allclose(plans[0].u, plans[1].u, atol=1e-4)
    with pytest.raises(lpvmpc.PlantError, match="embedding"):  # it is not f
        plant(a=2 * a)
    with pytest.raises(lpvmpc.PlantError, match=r"embedding, a: .* \(2, 2\)"):
        plant(a=a[0, :])
    with pytest.raises(lpvmpc.PlantError, match="x"):  # of s and p alone
        plant(a=a * x[0])
