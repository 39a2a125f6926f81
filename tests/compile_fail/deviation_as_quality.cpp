// expect: Deviation
#include <apso/types/score.hpp>

bool good(apso::Quality final_score) { return final_score.value() > 0.6; }

#ifdef CONTROL
bool use(apso::Deviation change) { return good(change.complement()); }
#else
bool use(apso::Deviation change) { return good(change); }
#endif
