#pragma once

#include <string>

namespace pepeseg {

// Versions of Landlock's interface, as the kernel numbers them, that introduced a feature.
// Renames between folders (Linux 5.19); the sandbox requires them.
inline constexpr int kLandlockRefer = 2;
inline constexpr int kLandlockTruncate = 3;  // truncation as a right of its own (Linux 6.2)
inline constexpr int kLandlockScopes = 6;    // signals and abstract sockets (Linux 6.12)

// Returns the version of this kernel's Landlock. 0: the kernel has none, or it is not enabled.
int LandlockVersion();

// Returns a sentence for the log about what the sandbox of workers cannot limit on a kernel with
// this version. Empty: the kernel supports everything that the sandbox uses.
std::string MissingFromSandbox(int landlock_version);

}  // namespace pepeseg
