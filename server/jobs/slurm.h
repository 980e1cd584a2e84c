#pragma once

#include <memory>

#include "server/jobs/launch_options.h"
#include "server/jobs/launcher.h"

namespace pepeseg {

// Workers as batch jobs of a Slurm cluster, by sbatch, squeue and scancel of PATH. They outlive
// this process; when their node is lost, or gives way to another job, Slurm starts them again.
// launch() is "slurm:NUMBER".
//
// Launch, Stop and Kill wait for Slurm's answer, 10 s at most; a thread asks for the state of all
// jobs every two seconds.
std::unique_ptr<Launcher> MakeSlurmLauncher(const LaunchOptions& options);

}  // namespace pepeseg
