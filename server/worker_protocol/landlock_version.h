#pragma once

#include <string>

namespace pepeseg {

// First versions of Landlock's interface, as the kernel numbers them, with these features.
inline constexpr int kLandlockRefer =
    2;  // renames between folders (Linux 5.19); the sandbox needs it
inline constexpr int kLandlockTruncate = 3;  // truncation as a right of its own (Linux 6.2)
inline constexpr int kLandlockScopes = 6;    // signals and abstract sockets (Linux 6.12)

// Returns the version of this kernel's Landlock; 0: it has none, or it is not enabled.
int LandlockVersion();

// Returns, as a sentence for the log, what the sandbox of workers does not limit on a kernel with
// this version. Empty: the kernel has everything that the sandbox uses.
std::string MissingFromSandbox(int landlock_version);

}  // namespace pepeseg
