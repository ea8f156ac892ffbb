"""config/cell.yaml: every name is one of the table's, and its objects are those of the object database."""
from pathlib import Path

import pytest
import yaml
from coglab_sim import _cell
from conftest import URDF

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


NUMBERS = [row for row in _cell.parameter_table() if row['low'] < row['high']]


def test_every_number_has_a_range_and_a_default_within():
    for row in _cell.parameter_table():
        value = row['default']
        if isinstance(value, (str, bool)):
            continue
        assert row['low'] < row['high'], row['name']
        for number in value if isinstance(value, list) else [value]:
            assert row['low'] <= number <= row['high'], row['name']


@pytest.mark.parametrize('row', NUMBERS, ids=lambda row: row['name'])
def test_numbers_out_of_range_are_refused_with_name_value_and_range(row):
    width = row['high'] - row['low']
    for bad in (row['low'] - 0.5 * width - 1.0, row['high'] + 0.5 * width + 1.0, float('nan'), float('inf')):
        value = row['default']
        if isinstance(value, list):
            value = [*value[:-1], bad]
        elif isinstance(value, int) and bad == bad and abs(bad) < 2e9:
            value = int(bad)
        else:
            value = bad
        with pytest.raises(ValueError) as error:
            _cell.Cell(URDF, {row['name']: value})
        text = str(error.value)
        assert row['name'] in text and f"range {row['low']:g}..{row['high']:g}" in text, text
        assert f'= {bad:g}'[:6] in text or 'nan' in text or 'inf' in text, text
