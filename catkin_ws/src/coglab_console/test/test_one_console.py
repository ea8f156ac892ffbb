"""One console per ROS master, even if the second has another ROS_HOME or runs on another computer."""

import contextlib
import os
import socket
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph
from coglab_console.ros import startup
from coglab_console.ros.startup import PLACE, StartError, announce, look_for_another
from coglab_py import node_start


@contextlib.contextmanager
def serving(functions):
    """An XML-RPC server on a free port, as the ROS master and every node have one."""
    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
    for name, function in functions.items():
        server.register_function(function, name)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join(60.0)


@pytest.fixture
def master():
    """A ROS master that only has parameters."""
    values = {}

    def get(_caller, name):
        return [1, "", values[name]] if name in values else [-1, f"Parameter [{name}] is not set", 0]

    def put(_caller, name, value):
        values[name] = value
        return [1, "", 0]

    with serving({"getParam": get, "setParam": put}) as uri:
        found = rosgraph.Master("/a_test", uri)
        found.values = values
        yield found


def node(pid):
    return serving({"getPid": lambda _caller: [1, "", pid]})


@pytest.fixture(autouse=True)
def quickly(monkeypatch):
    monkeypatch.setattr(startup, "PATIENCE", 0.3)
    monkeypatch.setattr(node_start, "ANSWER_LIMIT", 60.0)  # where silence is tested, it is short


def test_the_first_console_begins_and_the_second_is_told_where_the_first_is(master):
    look_for_another(master)
    with node(os.getpid()) as uri:
        announce(master, uri)
        assert master.values[PLACE] == [uri, os.getpid()]
        with pytest.raises(StartError) as refused:
            look_for_another(master)
        assert uri in str(refused.value)
    look_for_another(master)  # it has ended


def test_other_node_at_the_address_of_a_console_is_not_a_console(master):
    with node(4711) as uri:
        master.values[PLACE] = [uri, 4712]
        look_for_another(master)


def test_frozen_console_counts_as_running(master, monkeypatch):
    monkeypatch.setattr(node_start, "ANSWER_LIMIT", 0.3)
    with socket.socket() as frozen:
        frozen.bind(("127.0.0.1", 0))
        frozen.listen()
        master.values[PLACE] = [f"http://127.0.0.1:{frozen.getsockname()[1]}/", 4711]
        with pytest.raises(StartError, match="127.0.0.1"):
            look_for_another(master)


def test_a_node_of_a_computer_that_is_off_is_named_with_the_way_out(monkeypatch):
    monkeypatch.setattr(node_start, "ANSWER_LIMIT", 3.0)  # the master must answer, the node does not
    with socket.socket() as off:
        off.bind(("127.0.0.1", 0))
        off.listen()
        uri = f"http://127.0.0.1:{off.getsockname()[1]}/"
        with serving({"lookupNode": lambda _caller, _name: [1, "", uri]}) as master:
            assert "rosnode cleanup" in node_start.living(master, "/robot")


def test_start_waits_for_a_console_that_is_ending(master, monkeypatch):
    monkeypatch.setattr(startup, "PATIENCE", 10.0)
    with contextlib.ExitStack() as stack:
        uri = stack.enter_context(node(4711))
        master.values[PLACE] = [uri, 4711]
        threading.Timer(0.5, stack.close).start()
        look_for_another(master)


@pytest.mark.parametrize("value", ["x", 3, [], ["http://127.0.0.1:1/"], [3, 4], {"a": 1}, ["no address", 3], ["", 0]])
def test_foreign_value_of_the_parameter_refuses_no_console(master, value):
    master.values[PLACE] = value
    look_for_another(master)


def test_without_master_console_is_neither_refused_nor_delayed():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        gone = f"http://127.0.0.1:{probe.getsockname()[1]}/"
    look_for_another(rosgraph.Master("/a_test", gone))
