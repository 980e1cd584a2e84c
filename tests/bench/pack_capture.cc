// Developer program: imports a dataset folder and writes it as a capture pack,
// with the ground truth that the folder has.
#include <CLI/CLI.hpp>
#include <iostream>

#include "core/io/import.h"
#include "core/status_macros.h"
#include "tests/bench/capture_pack.h"
#include "tests/bench/truth_files.h"

namespace pepeseg {
namespace {

absl::Status Run(const std::string& folder, const std::string& path, bool disparity,
                 const ImportOptions& options) {
  ASSIGN_OR_RETURN(auto files, ListDataset(folder));
  for (DatasetFile& file : files) {
    if (disparity && file.kind == FileKind::kDepth) file.kind = FileKind::kDisparity;
  }
  CapturePack pack;
  ASSIGN_OR_RETURN(pack.capture, ImportCapture(files, options));
  for (const std::string& warning : pack.capture.warnings) std::cerr << warning << "\n";
  ASSIGN_OR_RETURN(pack.truth, ReadTruth(folder, pack.capture));
  for (const TruthLevel& level : pack.truth) std::cerr << "truth: " << level.name << "\n";
  return WriteCapturePack(path, pack);
}

}  // namespace
}  // namespace pepeseg

// NOLINTNEXTLINE(bugprone-exception-escape): CLI11 throws only what CLI11_PARSE catches.
int main(int argc, char** argv) {
  CLI::App app("A dataset folder as a capture pack");
  std::string folder, pack;
  bool disparity = false;
  pepeseg::ImportOptions options;
  app.add_option("folder", folder)->required();
  app.add_option("pack", pack)->required();
  app.add_flag("--disparity", disparity, "depth/ holds disparity");
  app.add_option("--image-scale", options.image_scale);
  CLI11_PARSE(app, argc, argv);
  const absl::Status status = pepeseg::Run(folder, pack, disparity, options);
  if (!status.ok()) std::cerr << status << "\n";
  return status.ok() ? 0 : 1;
}
