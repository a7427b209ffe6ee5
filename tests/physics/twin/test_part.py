"""What is inlined, what is called, and what tells a cache that they changed."""

from pathlib import Path
from types import ModuleType

from monochord.physics.twin.part import called, fingerprint, part


def test_parts_compile_alike() -> None:
    def root(x: float) -> float:
        return x**0.5

    assert part(root)(4.0) == called(root)(4.0) == 2.0


def test_a_fingerprint_follows_the_text(tmp_path: Path) -> None:
    module = ModuleType("drawn")
    module.__file__ = str(tmp_path / "drawn.py")
    found: list[int] = []
    for text in ("x = 1\n", "x = 2\n", "x = 1\n"):
        Path(module.__file__).write_text(text, encoding="utf-8")
        found.append(fingerprint([module]))
    assert found[0] == found[2] != found[1]
    assert 0 <= found[0] < 1 << 62
