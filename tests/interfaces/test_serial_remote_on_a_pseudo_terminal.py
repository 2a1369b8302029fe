"""The remote's protocol and its port: damage is noticed, the watchdog switches off, and every end is off."""

import json
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import spirillum as sp
from spirillum.cli import main
from spirillum.interfaces.serial_remote import WATCHDOG, Receiver, framed, unframed

pytest.importorskip("serial")
pty = pytest.mark.skipif(not hasattr(__import__("os"), "openpty"), reason="no pseudo-terminals")

ON = framed("DUTY 1 0.750")


def within(seconds: float, holds: Callable[[], bool]) -> bool:
    """Whether something becomes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if holds():
            return True
        time.sleep(0.005)
    return holds()


def fail_while_on(port: str) -> None:
    with sp.SerialRemote(port) as near:
        near.send(1.0)
        raise RuntimeError


def test_checksum_is_that_of_nmea() -> None:
    """The example of NMEA 0183 that every receiver of satellites prints."""
    body = "GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,"
    assert framed(body) == f"{body}*47\n".encode()
    assert unframed(f"{body}*47".encode()) == body


@given(place=st.integers(0, len(ON) - 2), byte=st.integers(0, 255))
def test_one_damaged_byte_moves_nothing(place: int, byte: int) -> None:
    damaged = bytearray(ON)
    damaged[place] = byte
    far = Receiver()
    far.receive(bytes(damaged), 0.0)
    same = bytes(damaged).upper() == ON.upper()
    assert far.duty(0.0) == (0.75 if same else 0.0)


@given(cut=st.lists(st.integers(0, 60), max_size=8), noise=st.binary(max_size=200))
def test_pieces_and_noise_lose_no_line(cut: list[int], noise: bytes) -> None:
    """Noise, the end of its line, then commands in any pieces: the last one counts."""
    stream = noise.replace(b"\n", b" ") + b"\n" + ON + framed("DUTY 2 0.250")
    far, before, answers = Receiver(), 0, b""
    for end in [*sorted(cut), len(stream)]:
        answers += far.receive(stream[before:end], 1.0)
        before = max(before, end)
    assert far.duty(1.0) == 0.25
    assert answers.endswith(framed("ACK 1 0.750") + framed("ACK 2 0.250"))


@pytest.mark.parametrize(
    ("body", "answer"),
    [
        ("WHO 7", "WHO 7 spirillum 500"),
        ("DUTY 8 1.000", "ACK 8 1.000"),
        ("OFF 9", "ACK 9 0.000"),
        ("DUTY 8 1.001", "NAK 8 unknown"),
        ("DUTY 8 nan", "NAK 8 unknown"),
        ("DUTY 8 1e-01", "NAK 8 unknown"),
        ("DUTY 8 -0.50", "NAK 8 unknown"),
        ("DUTY 8", "NAK 8 unknown"),
        ("DUTY x 0.500", "NAK 0 number"),
        ("JUMP 1", "NAK 1 unknown"),
    ],
)
def test_answers(body: str, answer: str) -> None:
    assert Receiver().receive(framed(body), 0.0) == framed(answer)


def test_watchdog_switches_off_and_wrong_lines_do_not_feed_it() -> None:
    far = Receiver()
    far.receive(ON, 10.0)
    assert far.duty(10.0 + WATCHDOG) == 0.75
    far.receive(b"DUTY 2 0.750*00\n" + framed("WHO 3") + framed("DUTY 4 2.000"), 10.4)
    assert far.duty(10.001 + WATCHDOG) == 0.0
    far.receive(framed("DUTY 5 0.100"), 20.0)
    assert far.duty(20.0) == 0.1


@pty
def test_duty_arrives_and_every_end_is_off() -> None:
    with sp.VirtualRemote() as far:
        with sp.SerialRemote(far.port) as near:
            assert (near.name, near.watchdog) == ("virtual", 0.5)
            assert near.send(0.1234) == far.duty == 0.123
            seen: list[float] = []
            near.hold(0.6, 0.2, told=lambda _passed: seen.append(far.duty))
            assert set(seen) == {0.6}
            assert far.duty == 0.0
            near.send(1.0)
        assert far.duty == 0.0
        with pytest.raises(RuntimeError):
            fail_while_on(far.port)
        assert far.duty == 0.0


@pty
def test_program_that_says_nothing_more_leaves_the_motor_off() -> None:
    with sp.VirtualRemote(watchdog=0.1) as far, sp.SerialRemote(far.port) as near:
        near.send(1.0)
        assert within(2.0, lambda: far.duty == 0.0)


@pty
@pytest.mark.parametrize("duty", [float("nan"), -0.1, 1.1, True, "1", None])
def test_no_wrong_duty_is_sent(duty: Any) -> None:
    with sp.VirtualRemote() as far, sp.SerialRemote(far.port) as near:
        with pytest.raises(sp.InputError, match=r"duty = .*; allowed: a number from 0 to 1"):
            near.send(duty)
        assert far.duty == 0.0


@pty
def test_unplugged_and_silent_remotes_are_a_sentence() -> None:
    far = sp.VirtualRemote(watchdog=0.1)
    near = sp.SerialRemote(far.port)
    far.deaf = True
    with pytest.raises(sp.InputError, match="does not answer DUTY"):
        near.send(0.5)
    far.deaf = False
    assert near.send(0.5) == 0.5
    far.unplug()
    with pytest.raises(sp.InputError, match=r"is gone .*watchdog switches the motor off"):
        near.hold(0.5, 1.0)
    near.close()
    assert within(2.0, lambda: far.duty == 0.0)


@pty
def test_ports_that_are_none_are_a_sentence() -> None:
    for port in ("/dev/no-such-port", "/dev/null"):
        with pytest.raises(sp.InputError, match=f"{port} cannot be opened"):
            sp.SerialRemote(port)
    with sp.VirtualRemote() as far, sp.SerialRemote(far.port), pytest.raises(sp.InputError, match="cannot be opened"):
        sp.SerialRemote(far.port)
    with sp.VirtualRemote() as far:
        far.deaf = True
        with pytest.raises(sp.InputError, match="does not answer WHO"):
            sp.SerialRemote(far.port)


@pty
@pytest.mark.parametrize("said", ["abc", "", "nan", "70000"])
def test_answers_that_are_no_numbers_are_a_sentence(said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with sp.VirtualRemote() as far, sp.SerialRemote(far.port) as near:
        monkeypatch.setattr(near, "_request", lambda verb, more="": f"ACK 7 {said}")
        with pytest.raises(sp.InputError, match="answers as no remote does"):
            near.send(0.5)
        with monkeypatch.context() as other:
            other.setattr(sp.SerialRemote, "_request", lambda self, verb, more="": f"WHO 1 x {said}")
            with sp.VirtualRemote() as second, pytest.raises(sp.InputError, match="answers as no remote does"):
                sp.SerialRemote(second.port)


@pty
def test_a_remote_has_a_word_for_its_name() -> None:
    for name in ("", "a b", "a\n", "\x00"):
        with pytest.raises(sp.InputError, match=r"name = .*; allowed: a word without spaces"):
            sp.VirtualRemote(name)
    with pytest.raises(sp.InputError, match="watchdog = 'x'; allowed: a number"):
        sp.VirtualRemote(watchdog="x")  # type: ignore[arg-type]


@pty
@pytest.mark.parametrize("baud", [0, -1, 2**31, 10**30])
def test_rates_of_symbols_that_no_port_has_are_a_sentence(baud: int) -> None:
    with pytest.raises(sp.InputError, match=r"baud = .*; allowed: 1 to"):
        sp.SerialRemote("/dev/no-such-port", baud=baud)


@pty
def test_command(capsys: pytest.CaptureFixture[str]) -> None:
    with sp.VirtualRemote() as far:
        with pytest.raises(SystemExit) as stopped:
            main(["remote", far.port, "--duty", "0.5", "--duration", "0.15s", "--json"])
        assert stopped.value.code in (0, None)
        answer = json.loads(capsys.readouterr().out)
        assert (answer["schema"], answer["duty"]["value"]) == ("spirillum.remote/1", 0.5)
        assert far.duty == 0.0
    for arguments, sentence in (
        (["/dev/no-such-port"], "cannot be opened"),
        ([far.port, "--duty", "nan"], "duty = nan"),
        ([far.port, "--duration", "0s"], "duration = 0 s; allowed: above 0 s"),
    ):
        with pytest.raises(SystemExit) as stopped:
            main(["remote", *arguments])
        assert stopped.value.code == 2
        assert sentence in capsys.readouterr().err
