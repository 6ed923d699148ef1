"""gateway.toml: what is read, and what a mistake is answered with."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from daemon.cli.main import app
from gateways.opcua.settings import GatewayError, read_settings

CELL = '[[cell]]\nname = "cell7"\nurl = "http://cell-7:8372"\n'


def test_paths_count_from_the_file_s_folder(tmp_path: Path) -> None:
    (tmp_path / "gateway.toml").write_text(CELL + 'key_file = "cell7.key"\n[server]\ntrusted = "clients"\n')
    (tmp_path / "cell7.key").write_text("hek_1\n")
    read = read_settings(tmp_path / "gateway.toml")
    assert (read.server.trusted, read.cell[0].key()) == (tmp_path / "clients", "hek_1")
    assert read.server.certificate == tmp_path / "pki/own/gateway.der"


def test_under_systemd_the_server_s_paths_count_from_the_state_that_it_may_write(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/handeyed-opcua")
    (tmp_path / "gateway.toml").write_text(CELL + 'key_file = "cell7.key"\n')
    read = read_settings(tmp_path / "gateway.toml")
    assert (str(read.server.trusted), read.cell[0].key_file) == (
        "/var/lib/handeyed-opcua/pki/trusted", tmp_path / "cell7.key",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "cell"),
        ("[[cell]", "line 1"),
        ('[[cell]]\nname = "cell 7"\nurl = "http://x"\n', "cell.0.name"),
        ('[[cell]]\nname = "a"\nurl = "ftp://x"\n', "cell.0.url"),
        (CELL + CELL, "one name"),
        (CELL + 'colour = "red"\n', "cell.0.colour"),
        (CELL + '[server]\nendpoint = "http://0.0.0.0:4840"\n', "server.endpoint"),
        (CELL + "[server]\nconnections = 0\n", "server.connections"),
    ],
)
def test_a_mistake_is_told_with_its_place(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "gateway.toml"
    file.write_text(text)
    with pytest.raises(GatewayError, match=r"docs/use/opcua\.md|correct the line") as error:
        read_settings(file)
    assert told in str(error.value)


def test_a_key_that_is_not_there_says_how_to_make_one(tmp_path: Path) -> None:
    (tmp_path / "gateway.toml").write_text(CELL + 'key_file = "none"\n')
    with pytest.raises(GatewayError, match="handeyed keys add SETTINGS gateway --role viewer"):
        read_settings(tmp_path / "gateway.toml").cell[0].key()


def test_the_command_ends_with_2_and_says_what_to_give(tmp_path: Path) -> None:
    ended = CliRunner().invoke(app, ["opcua", str(tmp_path / "none.toml")])
    assert ended.exit_code == 2
    assert "docs/use/opcua.md" in ended.output
