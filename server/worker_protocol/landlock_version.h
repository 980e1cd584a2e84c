#pragma once

#include <string>

namespace pepeseg {

// First versions of Landlock's interface, as the kernel counts them, that have ...
inline constexpr int kLandlockRefer = 2;     // renames between folders (Linux 5.19); used from here
inline constexpr int kLandlockTruncate = 3;  // truncation as a right of its own (Linux 6.2)
inline constexpr int kLandlockScopes = 6;    // signals and abstract sockets (Linux 6.12)

// Version of this kernel's Landlock; 0: it has none, or it is not enabled.
int LandlockVersion();

// What the sandbox of workers does not limit on a kernel with this version, as a sentence for the
// log. Empty: it limits all that it can limit anywhere.
std::string MissingFromSandbox(int landlock_version);

}  // namespace pepeseg
