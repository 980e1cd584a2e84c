#pragma once

#include <string>
#include <vector>

namespace pepeseg {

// Variable by which a worker of Slurm gets the database's URL. JobEnvironment does not pass it on.
inline constexpr char kSlurmDatabase[] = "PEPESEG_SLURM_DATABASE";

// Returns the variables of this process, as "NAME=VALUE", that a worker and the programs that it
// runs get: those of a short list (paths of programs and libraries, language, CUDA, numbers of
// threads, the cluster) and those named in `more`. The server's keys, passwords and addresses are
// not among them, since code that an uploaded file takes over can read every variable.
std::vector<std::string> JobEnvironment(const std::vector<std::string>& more);

// Returns the names of this process's variables that libpq reads (PGPASSFILE ...).
std::vector<std::string> DatabaseVariables();

}  // namespace pepeseg
