"""config/cell.yaml: every name is one of the table's, and its objects are those of the object database."""
from pathlib import Path

import pytest
import yaml
from conftest import URDF

from coglab_sim import _cell

PACKAGE = Path(__file__).resolve().parents[1]
CONFIG = yaml.safe_load((PACKAGE / 'config' / 'cell.yaml').read_text())
DATABASE = sorted((PACKAGE.parent / 'coglab_smach' / 'objects').glob('*.yaml'))


def test_names_are_known():
    names = {row['name'] for row in _cell.parameter_table()}
    given = {f'{group}/{name}': value for group in ('object', 'contact') for name, value in CONFIG[group].items()}
    assert set(given) <= names
    _cell.Cell(URDF, given)
    assert set(CONFIG) == {'object', 'contact', 'objects'}


@pytest.mark.parametrize('path', DATABASE, ids=lambda p: p.stem)
def test_objects_are_those_of_the_database(path):
    entry = yaml.safe_load(path.read_text())
    ours = CONFIG['objects'][entry['id']]
    assert (ours['mass'], ours['size'], ours['friction'], ours['shape']) == \
        (entry['mass'], entry['size'], entry['friction'], entry['shape']['type'])
    assert ours['center'] == pytest.approx([0.0, 0.0, entry['size'][2] / 2])
    _cell.Cell(URDF, {f'object/{name}': value for name, value in ours.items()})
