#pragma once

#include <string>
#include <vector>

// What keeps a job apart from the server: its environment, and the kernel's Landlock.
namespace pepeseg {

// Name of the variable in which a worker of Slurm gets the database's URL. JobEnvironment does not
// pass it on.
inline constexpr char kSlurmDatabase[] = "PEPESEG_SLURM_DATABASE";

// Returns those variables of this process, as "NAME=VALUE", that a worker and the programs that it
// runs may have: a fixed list (paths of programs and libraries, language, CUDA, numbers of threads,
// the cluster) and those named in `more`. Keys, passwords and addresses of the server are not on
// the list, since code that an uploaded file takes over can read every variable of its process.
std::vector<std::string> JobEnvironment(const std::vector<std::string>& more);

// Returns the names of this process's variables that libpq reads (PGPASSFILE ...).
std::vector<std::string> DatabaseVariables();

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
