#pragma once

#include <string>

namespace pepeseg {

// Returns the name under which this process holds jobs in a shared database: its machine's boot id,
// process namespace, process id and start time. No two processes that live at the same time have
// the same name, and a new process with an old process id has another name.
std::string HolderName();

// Returns whether the process with that name is known to have ended. False for a process that
// cannot be seen from here, such as one on another machine or in another container: its lease
// decides.
bool IsKnownGone(const std::string& holder);

}  // namespace pepeseg
