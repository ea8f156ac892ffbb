// Tries a library of plug-ins in a separate process, which the library may crash. PluginLibrary
// runs this program before it opens the library.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <string>

#include "ctrl_more/loading/plugin_types.hpp"
#include "loading/library_file.hpp"

namespace {

void report(const std::string& text) {
  const std::string line = text + "\n";
  if (write(ctrl_more::kProbeReport, line.data(), line.size()) < 0) _exit(1);
}

[[noreturn]] void refuse(const std::string& clause) {
  std::string line = clause;
  for (char& letter : line) {
    if (letter == '\n') letter = ' ';
  }
  report(ctrl_more::kProbeError + line);
  _exit(1);
}

// Exceptions are ignored here. The program that makes the controller reports them.
void make(const ctrl_more::PluginTypes& types, const std::string& type) {
  report("while " + types.kind() + " '" + type + "' was made");
  try {
    types.tryOne(type);
  } catch (...) {
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit no_core{0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  report("while it was opened");
  void* library = nullptr;
  try {
    library = ctrl_more::openLibrary(argv[1]);
  } catch (const std::exception& error) {
    refuse(std::string("threw while it was opened: ") + error.what());
  } catch (...) {
    refuse("threw something that is not a std::exception while it was opened");
  }
  if (!library) refuse(std::string("cannot be loaded: ") + dlerror());
  for (const ctrl_more::PluginTypes* types : ctrl_more::PluginTypes::all()) {
    for (const std::string& type : types->types()) make(*types, type);
  }
  report("while it was closed");
  dlclose(library);
  report(ctrl_more::kProbeDone);
  _exit(0);
}
