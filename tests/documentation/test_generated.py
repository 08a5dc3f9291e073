"""Content of READMEs from the program is up to date: generated parts, sessions, the test
command."""

import re
import shlex

import pytest
from click.testing import CliRunner

import readmes
from separate_streams import runner
from tdint.methods.catalogue import DEFAULT_METHOD
from tdint_cli.main import cli

AGAIN = "run: python tests/readmes.py"


def relative_path(path):
    return str(path.relative_to(readmes.ROOT))


@pytest.mark.parametrize("path", readmes.files(), ids=relative_path)
def test_generated_parts_are_up_to_date(path):
    text = path.read_text()
    assert readmes.generated(text) == text, AGAIN


def test_every_generated_part_is_in_one_readme():
    found = [
        name
        for path in readmes.files()
        for name in re.findall(r"^<!-- generated: (\w+) -->", path.read_text(), re.M)
    ]
    assert sorted(found) == sorted(readmes.PARTS)


def sessions():
    """Return READMEs with sessions. Only the sessions of the first page are fast tests."""
    paths = [readme for readme in readmes.files() if readmes.sessions(readme.read_text())]
    return [
        pytest.param(path, marks=[pytest.mark.slow] * (path != readmes.README)) for path in paths
    ]


def run_here(line, folder, environment):
    """Run `tdint ... | FILTERS` with the results of `readmes.shell`, but tdint in this process."""
    command, _, filters = line.partition(" | ")
    result = runner().invoke(cli, shlex.split(command)[1:], prog_name="tdint")
    _, output, _ = readmes.shell(
        f"{{ {filters or 'cat'}; }} << 'END'\n{result.stdout}END", folder, environment
    )
    return result.exit_code, output, re.sub("note: compiling .*\n", "", result.stderr)


@pytest.mark.usefixtures("not_laid_out")
@pytest.mark.parametrize("path", sessions(), ids=relative_path)
def test_sessions_print_the_documented_output(path, monkeypatch):
    """Sessions of the first page run in this process."""
    run = run_here if path == readmes.README else readmes.shell
    for session in readmes.sessions(path.read_text()):
        with readmes.checkout() as (folder, environment), monkeypatch.context() as patch:
            patch.chdir(folder)
            for command, shown in session:
                code, output, messages = run(command, folder, environment)
                assert code == 0, messages
                assert readmes.same(output + messages, shown), (
                    f"{command}\n{output}{messages}\n{AGAIN}"
                )


def test_the_comparison_of_sessions_detects_differences():
    line = "impulse4: 4000 steps of 0.01 s, 4.47 us per step, energy error 1.0e-05.\n"
    assert readmes.same(line, line.replace("4.47 us", "0.5 us"))
    assert readmes.same("1,0.0121613414291\n", "1,0.0121613414200\n")
    assert not readmes.same("1,0.0121613414\n", "1,0.0121713414\n")
    assert not readmes.same(line, line.replace("4000", "4001"))
    assert not readmes.same(line, line.replace("steps", "halvings"))


def test_the_recommended_method_is_the_default():
    """The pages and `tdint methods` recommend the method that is the default."""
    texts = [(readmes.ROOT / "src" / "tdint" / "methods" / "README.md").read_text()]
    texts.append(CliRunner().invoke(cli, ["methods", "--help-all"]).output)
    first_page = " ".join(readmes.README.read_text().split())
    assert re.findall(r"The default `(\w+)", first_page) == [DEFAULT_METHOD]
    for text in texts:
        assert re.findall(r"If in doubt: `?(\w+)", " ".join(text.split())) == [DEFAULT_METHOD]


def test_the_ci_script_runs_the_test_command_of_the_readme():
    commands = re.findall(r"^\$ (.*\.\[test\].*)$", readmes.README.read_text(), re.MULTILINE)
    assert len(commands) == 1
    assert commands[0].endswith("-m pytest -n auto")
    script = readmes.ROOT / ".ci" / "run"
    if not script.exists():
        pytest.skip("the source archive does not hold .ci/run")
    assert "README.md" in script.read_text()
