// A library without a controller.
extern "C" int answer() { return 42; }
