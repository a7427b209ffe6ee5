import subprocess
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.weights import checked_sum, find_weights, load_known, weight_names


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("MONOCHORD_AST", "MONOCHORD_YAMNET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("MONOCHORD_WEIGHTS", str(tmp_path / "weights"))
    return tmp_path / "weights"


@pytest.mark.parametrize("name", weight_names())
def test_what_is_known_says_where_from_and_under_which_licence(name: str) -> None:
    known = load_known(name)
    assert known.url.startswith("https://")
    assert known.url.endswith(known.file)
    assert known.source
    assert known.licence
    assert known.sha256 or known.reader, "neither a sum nor a look inside"


def test_a_name_mistyped_is_answered_with_it() -> None:
    with pytest.raises(InputError, match=r"weights 'yamnte': allowed is ast, yamnet .*did you mean 'yamnet'"):
        load_known("yamnte")


def test_they_are_looked_for_where_named_then_in_the_variable_then_in_the_folder(
    own_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = load_known("ast")
    with pytest.raises(InputError, match=r"(?s)not there.*'monochord weights get ast'.*MONOCHORD_AST"):
        find_weights(known)
    usual = own_folder / "ast" / known.file
    usual.parent.mkdir(parents=True)
    usual.touch()
    assert find_weights(known) == usual
    other = tmp_path / "other"
    other.mkdir()
    (other / known.file).touch()
    monkeypatch.setenv("MONOCHORD_AST", str(other))
    assert find_weights(known) == other / known.file
    (tmp_path / "mine.safetensors").touch()
    assert find_weights(known, str(tmp_path / "mine.safetensors")) == tmp_path / "mine.safetensors"
    with pytest.raises(InputError, match="gone"):
        find_weights(known, str(tmp_path / "gone"))


def test_without_a_folder_of_their_own_they_are_with_the_users_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MONOCHORD_WEIGHTS")
    monkeypatch.setenv("XDG_DATA_HOME", "/somewhere")
    assert load_known("ast").usual_path == Path("/somewhere/monochord/weights/ast/model.safetensors")


def test_weights_that_nothing_pins_are_said_to_be_so_with_the_way_to_pin_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file, known = tmp_path / "my weights", replace(load_known("ast"), sha256="")
    file.write_bytes(b"numbers")
    own = checked_sum(known, file)
    (line,) = caplog.messages
    assert own in line
    subprocess.run(line.partition("pin it: ")[2], shell=True, check=True)  # noqa: S602
    checked_sum(known, file)
    assert len(caplog.messages) == 1
    file.write_bytes(b"others")
    with pytest.raises(InputError, match="weights get ast"):
        checked_sum(known, file)


def test_a_sum_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="64 hexadecimal digits"):
        replace(load_known("ast"), sha256="abc")


def test_a_sum_is_compared_with_what_is_known_and_with_what_was_kept(tmp_path: Path) -> None:
    file = tmp_path / "weights"
    file.write_bytes(b"numbers")
    own = sha256(b"numbers").hexdigest()
    known = replace(load_known("ast"), sha256="")
    assert checked_sum(known, file) == own
    assert checked_sum(replace(known, sha256=own), file) == own
    with pytest.raises(InputError, match=rf"SHA-256 {own[:12]}\.\.\.: allowed is 000000000000"):
        checked_sum(replace(known, sha256=64 * "0"), file)
    (tmp_path / "weights.sha256").write_text(f"{own}\n", encoding="ascii")
    file.write_bytes(b"other numbers")
    with pytest.raises(InputError, match=rf"allowed is {own[:12]}.*weights get ast"):
        checked_sum(known, file)
