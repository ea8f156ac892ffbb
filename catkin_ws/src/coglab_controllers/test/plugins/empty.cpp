// A shared object without any controller.
extern "C" int coglabNothingHere() { return 0; }
