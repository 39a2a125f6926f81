// expect: apso needs C++17: compile with -std=c++17 or a later standard
// with: -std=c++14
#include <apso/score.hpp>

double use(const apso::Quality& q) { return q.value(); }
