#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/sfm/colmap_program.h"
#include "core/sfm/front/compare_photographs.h"
#include "core/sfm/model_agreement.h"
#include "core/sfm/sfm_model.h"

namespace pepeseg {

struct MappingInput {
  std::filesystem::path database, images;
  std::filesystem::path models;                // a folder that is there; gets a folder for each try
  std::string threads;                         // COLMAP's option, where COLMAP compared
  const ComparedDatabase* compared = nullptr;  // what the own front found; null: COLMAP compared
};

struct MappedModels {
  std::vector<SfmModel> models;  // see ReadSfmModels
  ModelAgreement agreement;      // of the first model; nothing if COLMAP compared
};

// Runs COLMAP's incremental mapper by `run`. With the pairs of the own front, the largest model is
// then compared with all verified matches. If it is not plausible, up to three further runs start
// from other pairs (InitialPairs), until one is, and the model with most agreeing matches is kept.
// Errors of `run`, ReadSfmModels and MeasureAgreement.
absl::StatusOr<MappedModels> MapIncrementally(
    const MappingInput& input, absl::FunctionRef<absl::Status(const ColmapProgram::Command&)> run);

}  // namespace pepeseg
