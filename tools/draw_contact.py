"""Draw the pictures of docs/contact.md: load of the rotor, B_eff, body rate and azimuth, and forces towards the wall.

Some twenty seconds; the robots are the presets, laid down and let go as `spirillum study --predicted` does.
"""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from yawed_cylinder import pulls

import spirillum as sp
from spirillum.view.figures.style import COLOURS, new_figure, styled

TARGET = Path(__file__).parent.parent / "docs" / "images" / "contact.png"
STUDY: dict[str, Any] = {
    "models": ["rft"],
    "friction": ["rotor"],
    "predicted": True,
    "grid": {
        "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
        "wavelengths": ["25 mm"],
        "amplitudes": ["2.5 mm"],
    },
}
TUBES = {"wide": (COLOURS["blue"], "o"), "narrow": (COLOURS["vermillion"], "s")}
"""Colour and marker of each tube."""
STARTS: dict[str, tuple[dict[str, Any], Any]] = {
    "at once: film": ({"wait": "0 s", "friction_coefficient": 0.3}, "-"),
    "after 60 s, no friction": ({"wait": "60 s", "friction_coefficient": 0.0}, (0, (5, 2))),
    "after 60 s, dry (0.3)": ({"wait": "60 s", "friction_coefficient": 0.3}, (0, (1, 1.2))),
}
"""How long each robot lies before its motor is on, friction coefficient, and line."""
HZ = 2.0 * np.pi


def parts_of_the_load(robot: str, tail_rate: float) -> dict[str, float]:
    """Rotor's hydrodynamic torque at a tail rate, model by model, uN m."""
    loads = {
        "RFT, the tail": sp.predict(robot, model="rft", tail_rate=tail_rate).tail_torque,
        "resolved tail": sp.resistance(robot, part="tail", model="slender").matrix[3, 3] * tail_rate,
        "and coupling, body": sp.predict(robot, model="slender", tail_rate=tail_rate).tail_torque,
        "in the tube": sp.predict(robot, model="tube", tail_rate=tail_rate, band=False).tail_torque,
    }
    return {name: 1e6 * float(load) for name, load in loads.items()}


def draw_loads(axes: Axes, robot: str, run: Any) -> None:
    """Bars: what the motor gives, and what of it each model's rotor takes."""
    tail = float(run["tail_rotation_rate_at_run"])
    given = 1e6 * sp.load(robot).motor.torque_constant * float(run["motor_current_at_run"])
    loads = parts_of_the_load(robot, tail)
    print(
        robot, f"motor {given:.1f} uN m at {tail / HZ:.3f} Hz:", {name: round(load, 1) for name, load in loads.items()}
    )
    axes.barh(list(loads), list(loads.values()), color=COLOURS["blue"], height=0.6)
    axes.axvline(given, color="black", linestyle=(0, (4, 2)), linewidth=1.0)
    axes.text(given - 3.0, -0.62, "motor torque", ha="right", va="center")
    for number, load in enumerate(loads.values()):
        axes.annotate(
            f"{load:.0f}", (load, number), (-4, 0), textcoords="offset points", ha="right", va="center", color="white"
        )
    axes.set_ylim(3.5, -0.95)
    axes.set_xlim(0.0, 1.12 * given)
    axes.set_xlabel("torque on the rotor (µN m)")
    axes.set_title(r"a  What $B_\mathrm{eff}$ stands for", loc="left")


def draw_readings(axes: Axes, dataset: Any) -> None:
    """Inferred B_eff against the body's rate, all readings."""
    for name, (colour, marker) in TUBES.items():
        rate = np.abs(dataset["body_rotation_rate_at_run"].sel(channel=name).values.ravel()) / HZ
        found = dataset["effective_friction_at_run"].sel(channel=name, inferred_by="rft").values.ravel()
        print(
            name,
            f"body {rate.min():.4f} to {rate.max():.4f} Hz, B_eff {1e6 * found.min():.2f} to {1e6 * found.max():.2f}",
        )
        azimuth = np.degrees(dataset["azimuth_at_run"].sel(channel=name, window="whole run").values)
        friction, wait = dataset["friction_coefficient_of_run"].values, dataset["wait_of_run"].values
        for dry in (False, True):
            for waited in (False, True):
                chosen = azimuth[((friction > 0) == dry) & ((wait > 0) == waited)]
                print(name, f"dry {dry}, waited {waited}: azimuth {chosen.min():.1f} to {chosen.max():.1f} deg")
        axes.plot(rate, 1e6 * found, linestyle="", marker=marker, color=colour, markersize=5, label=f"{name} tube")
    axes.set_xscale("log")
    axes.set_xticks([0.001, 0.003, 0.01, 0.03, 0.1], ["0.001", "0.003", "0.01", "0.03", "0.1"])
    axes.minorticks_off()
    axes.set_ylim(0.0, 12.0)
    axes.set_xlabel("body rate (Hz)")
    axes.set_ylabel(r"$B_\mathrm{eff}$ by (18) (µN m s)")
    axes.legend(loc="lower left")
    axes.set_title("b  Film and contact turn the body", loc="left")


def draw_azimuths(axes: Axes) -> None:
    """Azimuth over time: film and dry contact carry the robot opposite ways."""
    for name, (colour, _) in TUBES.items():
        for words, (start, line) in STARTS.items():
            run = sp.simulate(
                f"biorob2012-{name}",
                model="tube",
                timing={"duration": "12 s", "samples_per_turn": 20},
                roughness="30 um",
                placement={"gap": "0.5 mm"},
                in_tube=start,
            )
            turned = np.degrees(run["azimuth"].values - run["azimuth"].values[0])
            print(name, words, f"{turned[-1]:.1f} deg")
            axes.plot(run["time"], turned, color=colour, linestyle=line, label=words if name == "wide" else None)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel("time with the motor on (s)")
    axes.set_ylabel("azimuth (deg)")
    axes.set_ylim(-16.5, 10.0)
    axes.legend(loc="upper left")
    axes.set_title("c  and carry it to opposite sides", loc="left")


FORCES = {"weight_load": "weight", "film_load": "film", "outer_load": "other fluid", "contact_load": "asperities"}


def draw_forces() -> None:
    """Forces towards the wall of a robot that has waited ten minutes, and the yaw that moves them."""
    run = sp.simulate("biorob2012-wide", model="tube", timing={"duration": "20 s"}, in_tube={"wait": "600 s"})
    with styled():
        figure = new_figure(10.6, 2.9)
        left, right, simple = figure.subplots(1, 3, width_ratios=(1.3, 1.0, 1.0))
        for (name, words), colour in zip(FORCES.items(), ("black", "blue", "green", "vermillion"), strict=True):
            left.plot(run["time"], 1e3 * run[name], color=COLOURS.get(colour, colour), label=words)
        left.set_ylabel("force towards the wall (mN)")
        left.legend(loc="upper left", ncols=2)
        left.set_ylim(-160.0, 210.0)
        left.set_title("a  The film pulls, asperities carry", loc="left")
        right.plot(run["time"], np.degrees(run["wall_yaw"]), color=COLOURS["orange"])
        right.set_ylabel("yaw (deg)")
        right.set_title("b  as the tail yaws the body", loc="left")
        for axes in (left, right):
            axes.set_xlabel("time with the motor on (s)")
        draw_cylinder(simple)
        figure.tight_layout()
        figure.savefig(TARGET.with_name("contact-forces.png"), dpi=130)


def draw_cylinder(axes: Axes) -> None:
    """The pull on a cylinder with a yawing moment, against finite differences of Reynolds' equation."""
    for bound, words, colour in ((np.inf, "no bound", "blue"), (1e4, "10 kPa", "vermillion")):
        found = pulls(bound)
        axes.plot(found["time"], 1e3 * found["pull"], color=COLOURS[colour], label=words)
        axes.plot(found["at"], 1e3 * found["reynolds"], linestyle="", marker="o", markersize=4, color=COLOURS[colour])
    axes.set_xlabel("time (s)")
    axes.set_ylabel("pull of the film (mN)")
    axes.set_ylim(0.0, 120.0)
    axes.legend(loc="upper left")
    axes.set_title("c  as a cylinder (dots: Reynolds)", loc="left")


def draw() -> None:
    """Compute, draw, save."""
    dataset = sp.study(STUDY).isel(wavelength=0, amplitude=0)
    with styled():
        figure = new_figure(10.6, 3.7)
        left, middle, right = figure.subplots(1, 3, width_ratios=(1.15, 1.0, 1.0))
        draw_loads(left, "biorob2012-wide", dataset.sel(channel="wide", window="whole run").isel(run=0))
        draw_readings(middle, dataset)
        draw_azimuths(right)
        figure.tight_layout()
        figure.savefig(TARGET, dpi=130)


if __name__ == "__main__":
    draw()
    draw_forces()
