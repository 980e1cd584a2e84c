#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// Compares the SHA-256 of each file of the spec with the one that its owner declared. An attempt
// calls it once, before it decodes anything: what a disk has changed since the upload is never
// trained on. Reads with `spec.num_threads` threads, each distinct blob once.
//
// DATA_LOSS names the first file whose stored bytes are damaged or gone, as its owner calls it, and
// says how many there are; their digests are added to `damaged`, each once. INTERNAL names a file
// that cannot be read: nothing is known of its bytes then.
absl::Status VerifyInputs(const JobSpec& spec, std::vector<std::string>& damaged);

}  // namespace pepeseg
