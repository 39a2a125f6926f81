// expect: Deviation
#include <apso/types/score.hpp>

#ifdef CONTROL
bool use(apso::Quality frame, apso::Deviation change) { return frame < change.complement(); }
#else
bool use(apso::Quality frame, apso::Deviation change) { return frame < change; }
#endif
