// expect: apso: deprecated since 0.1: use new_name()
#include <apso/config.hpp>

#pragma GCC diagnostic error "-Wdeprecated-declarations"

int new_name() { return 1; }
APSO_DEPRECATED("0.1", "use new_name()") int old_name() { return new_name(); }

#ifdef CONTROL
int use() { return new_name(); }
#else
int use() { return old_name(); }
#endif
