#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

// Whether all bytes of a sealed dataset are there: a damaged blob may have been set aside since.
// FAILED_PRECONDITION names the first file whose bytes are not, and says how many those are. Also
// brings the store up to date with the disk: bytes that came again by any upload of the project
// make the dataset whole. Looks at sizes only; a training reads all bytes.
absl::Status CheckFilesStored(const ServiceContext& context, const std::string& scene,
                              int64_t dataset);

}  // namespace pepeseg
