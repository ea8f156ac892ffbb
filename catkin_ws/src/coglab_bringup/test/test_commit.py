"""The commit is found without git, however the checkout keeps it."""

import pytest
from coglab_bringup.commit import commit_of, commit_seed, folder_seed

COMMIT = "0abc123" + "4" * 33


def detached(git):
    (git / "HEAD").write_text(COMMIT + "\n")


def loose(git):
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "refs" / "heads" / "main").write_text(COMMIT + "\n")


def packed(git):
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "packed-refs").write_text(
        f"# pack-refs with: peeled\n{'5' * 40} refs/heads/other\n{COMMIT} refs/heads/main\n"
    )


@pytest.mark.parametrize("kept", [detached, loose, packed])
def test_found_without_git(kept, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))  # no git
    (tmp_path / ".git").mkdir()
    kept(tmp_path / ".git")
    assert commit_of(tmp_path) == COMMIT and commit_seed(tmp_path) == 0x0ABC123
    assert folder_seed(tmp_path, tmp_path / "package") == 0x0ABC123


@pytest.mark.parametrize("kept", [loose, packed])
def test_found_in_a_second_worktree(kept, tmp_path):
    common, own = tmp_path / "main" / ".git", tmp_path / "main" / ".git" / "worktrees" / "second"
    own.mkdir(parents=True)
    kept(common)
    (own / "HEAD").write_text("ref: refs/heads/main\n")
    (own / "commondir").write_text("../..\n")
    (tmp_path / "second").mkdir()
    (tmp_path / "second" / ".git").write_text(f"gitdir: {own}\n")
    assert commit_of(tmp_path / "second") == COMMIT


def test_outside_of_a_checkout(tmp_path):
    assert commit_of(tmp_path) == "unknown" and commit_seed(tmp_path) == 1
