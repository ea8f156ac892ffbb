#include "own_master.hpp"

int main(int count, char** words) {
  return coglab_rt::runWithOwnMaster(count, words, "coglab_rt_test");
}
