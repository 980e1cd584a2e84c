#pragma once

#include <filesystem>
#include <memory>

#include "absl/status/statusor.h"
#include "core/priors/sam/prompted_segmenter.h"

namespace pepeseg {

// A small SAM (TinyViT's encoder) from a folder that deploy/sam.sh has made, on the CPU. The errors
// of CheckSamFiles; FAILED_PRECONDITION also where the library does not load or the models are not
// the expected ones; RESOURCE_EXHAUSTED: out of memory.
absl::StatusOr<std::unique_ptr<PromptedSegmenter>> OpenSam(const std::filesystem::path& folder,
                                                           int num_threads);

}  // namespace pepeseg
