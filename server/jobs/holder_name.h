#pragma once

#include <string>

namespace pepeseg {

// The name of this process in a shared database: boot of its machine, process namespace, process id
// and start time. No two processes that live at the same time have the same name.
std::string HolderName();

// Whether the process of that name is known to have ended. False for processes that cannot be seen
// from here, such as those of another machine or container.
bool IsKnownGone(const std::string& holder);

}  // namespace pepeseg
