#include "core/train/training_inputs.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "core/base/errors.h"
#include "core/model_files/manifest.h"

namespace pepeseg {

std::vector<std::filesystem::path> TrainingFolders::all() const {
  std::vector<std::filesystem::path> folders = {run};
  folders.insert(folders.end(), earlier.begin(), earlier.end());
  return folders;
}

// The manifest is written last, so that a folder without one, or with a file that differs from it,
// was left by an interrupted run.
std::optional<std::filesystem::path> FindWhole(const TrainingFolders& folders, const char* name) {
  // The manifest's digests are compared with the files, so that a damaged folder is made again.
  for (const std::filesystem::path& run : folders.all()) {
    const absl::StatusOr<Manifest> manifest = ReadManifest(run / name);
    if (manifest.ok() && VerifyManifest(run / name, *manifest).ok()) return run / name;
  }
  return std::nullopt;
}

void RemoveIntermediates(const TrainingFolders& folders) {
  std::error_code ignored;
  for (const std::filesystem::path& run : folders.earlier) {
    std::filesystem::remove_all(run, ignored);
  }
  std::filesystem::remove_all(folders.priors, ignored);
  // Only the intermediate folders of this run go: the model lies next to them.
  for (const char* name :
       {kHeicFolder, kFramesFolder, kPosesFolder, kEarlyFolder, kReconstructFolder, kGivenFolder}) {
    std::filesystem::remove_all(folders.run / name, ignored);
  }
}

absl::StatusOr<int64_t> BytesIn(const std::filesystem::path& folder) {
  int64_t num_bytes = 0;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->is_regular_file(error)) num_bytes += static_cast<int64_t>(entry->file_size(error));
  }
  if (error) return FileError(folder, "list", error.value());
  return num_bytes;
}

bool HasKind(std::span<const DatasetFile> files, FileKind kind) {
  return std::any_of(files.begin(), files.end(),
                     [kind](const DatasetFile& file) { return file.kind == kind; });
}

std::string TextOf(const Source& source) {
  switch (source.kind) {
    case Source::Kind::kUnknown:
      return "";
    case Source::Kind::kNone:
      return "none";
    case Source::Kind::kGiven:
      return "given";
    case Source::Kind::kEmbedded:
      return "embedded";
    case Source::Kind::kSam:
      return "sam";
    case Source::Kind::kSamAndEmbedded:
      return "sam and embedded";
    case Source::Kind::kProgram:
      return source.program;
  }
  return "";
}

std::map<std::string, std::string> ByName(const Sources& sources) {
  std::map<std::string, std::string> named;
  for (const auto& [name, source] :
       {std::pair("poses", &sources.poses), {"masks", &sources.masks}, {"depth", &sources.depth}}) {
    if (source->kind != Source::Kind::kUnknown) named[name] = TextOf(*source);
  }
  return named;
}

}  // namespace pepeseg
