#pragma once

#include <string>

namespace pepeseg {

// What this process calls itself where others can see it: the boot of its machine, its process
// namespace, number and start time. No two that are alive at a time have the same.
std::string HolderName();

// Whether the process of that name is known to have ended. False where nobody here can tell, as of
// another machine or container.
bool IsKnownGone(const std::string& holder);

}  // namespace pepeseg
