#pragma once

#include <string>
#include <vector>

namespace pepeseg {

// Variable by which a worker of Slurm's gets the database's URL. It is on no list below.
inline constexpr char kSlurmDatabase[] = "PEPESEG_SLURM_DATABASE";

// The variables of this process that a worker and the programs that it runs get, as "NAME=VALUE":
// those of a short list (paths of programs and libraries, language, CUDA's, numbers of threads, the
// cluster's) and of `more`, by name. Not the server's keys, passwords and addresses: code that an
// uploaded file takes over can read all of it.
std::vector<std::string> JobEnvironment(const std::vector<std::string>& more);

// Names of the variables that libpq reads (PGPASSFILE ...) which this process has.
std::vector<std::string> DatabaseVariables();

}  // namespace pepeseg
