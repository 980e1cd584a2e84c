#pragma once

#include <string>
#include <vector>

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

}  // namespace pepeseg
