#include <fstream>

#include "bindings.hpp"

namespace ctrl_more::python {
namespace {

/// Passes each record to a Python function. Only drain() calls it, so no cycle waits for Python.
class FunctionSink : public LogSink {
 public:
  explicit FunctionSink(py::object function) : function_(std::move(function)) {}
  ~FunctionSink() override {
    if (!Py_IsInitialized()) {
      function_.release();
      return;
    }
    py::gil_scoped_acquire locked;
    function_ = py::object();
  }
  void write(const LogRecord& record) override {
    py::gil_scoped_acquire locked;
    try {
      function_(record);
    } catch (py::error_already_set& error) {
      error.discard_as_unraisable("a sink of ctrl_more.Logger");
    }
  }

 private:
  py::object function_;
};

}  // namespace

Logger& pythonLogger() {
  static auto* the_logger = new Logger();  // never destroyed: stores may outlive the module
  return *the_logger;
}

void bindLogger(py::module_& module) {
  py::class_<LogRecord>(module, "LogRecord", "One drained record.")
      .def_property_readonly(
          "level",
          [](const LogRecord& r) {
            static const char* const names[] = {"debug", "info", "warning", "error"};
            return names[static_cast<int>(r.level)];
          })
      .def_property_readonly("source",
                             [](const LogRecord& r) { return std::string(r.source.data()); })
      .def_property_readonly("file", [](const LogRecord& r) { return std::string(r.file.data()); })
      .def_readonly("line", &LogRecord::line)
      .def_readonly("cycle", &LogRecord::cycle)
      .def_readonly("time_ns", &LogRecord::time_ns)
      .def_property_readonly("message", &LogRecord::message)
      .def("__str__", &LogRecord::toLine);

  py::class_<Logger>(module, "Logger", "Ring of records; drain() gives them to the sinks.")
      .def(py::init<std::size_t>(), py::arg("capacity") = 1024)
      .def(
          "add_sink",
          [](Logger& logger, py::object sink) {
            if (py::isinstance<py::str>(sink) || py::hasattr(sink, "__fspath__")) {
              const auto path = py::module_::import("os").attr("fspath")(sink).cast<std::string>();
              return logger.addSink(std::make_shared<FileLogSink>(path));
            }
            if (!PyCallable_Check(sink.ptr()))
              throw py::type_error(
                  "sink: expected a function of one record, or the path of a file");
            logger.addSink(std::make_shared<FunctionSink>(std::move(sink)));
          },
          py::arg("sink"))
      .def(
          "set_level",
          [](Logger& logger, const std::string& level) { logger.setLevel(toLevel(level)); },
          py::arg("level"))
      .def(
          "log",
          [](Logger& logger, const std::string& level, const std::string& source,
             const std::string& text) { logger.log(toLevel(level), source, text); },
          py::arg("level"), py::arg("source"), py::arg("text"))
      .def("drain", &Logger::drain, py::call_guard<py::gil_scoped_release>())
      .def_property_readonly("dropped", &Logger::dropped);
  module.attr("logger") = py::cast(&pythonLogger(), py::return_value_policy::reference);
}

}  // namespace ctrl_more::python
