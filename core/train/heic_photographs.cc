#include "core/train/heic_photographs.h"

#include <array>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>

#include "absl/strings/str_format.h"
#include "core/base/atomic_file.h"
#include "core/base/file_bytes.h"
#include "core/base/file_error.h"
#include "core/base/status_macros.h"
#include "core/formats/decode_image.h"
#include "core/formats/heic.h"
#include "core/formats/heic_header.h"
#include "core/model_files/manifest.h"

namespace pepeseg {
namespace {

// By its first bytes: phones also upload HEIC files that are named ".jpg".
bool BeginsAsHeic(const std::filesystem::path& path) {
  std::array<char, 16> start{};
  std::ifstream file(path, std::ios::binary);
  file.read(start.data(), start.size());
  return file.gcount() == start.size() &&
         IsHeic({reinterpret_cast<const uint8_t*>(start.data()), start.size()});
}

// The index among the files: the owner's name for a file is never used as a path.
std::string JpegName(size_t index) { return absl::StrFormat("%06d.jpg", index); }

absl::Status ConvertHeicFile(const DatasetFile& file, const std::filesystem::path& jpeg) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(file.path, file.name, kMaxImageFileBytes));
  ASSIGN_OR_RETURN(
      const std::string converted,
      HeicToJpeg({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, file.name));
  return WriteFileAtomically(jpeg, converted);
}

// Writes the JPEGs, and the manifest last: a folder without one is not taken by a later run.
absl::StatusOr<std::filesystem::path> ConvertAll(const TrainingFolders& folders, StageLog& stages,
                                                 const std::vector<DatasetFile>& files,
                                                 const std::vector<size_t>& heic) {
  const std::filesystem::path folder = folders.run / kHeicFolder;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "create", error.value());
  std::vector<std::string> names;
  for (const size_t index : heic) {
    StepReport report;
    report.stage = "prepare";
    report.step = static_cast<int64_t>(names.size());
    report.num_steps = static_cast<int64_t>(heic.size());
    report.activity = "converting";
    report.unit = "photographs";
    RETURN_IF_ERROR(stages.Step(report));
    names.push_back(JpegName(index));
    RETURN_IF_ERROR(ConvertHeicFile(files[index], folder / names.back()));
  }
  ASSIGN_OR_RETURN(const Manifest manifest, BuildManifest(folder, names));
  RETURN_IF_ERROR(WriteManifest(folder, manifest));
  return folder;
}

}  // namespace

absl::Status ConvertHeicPhotographs(const TrainingFolders& folders, StageLog& stages,
                                    std::vector<DatasetFile>& files) {
  std::vector<size_t> heic;
  for (size_t i = 0; i < files.size(); ++i) {
    if (files[i].kind == FileKind::kImage && BeginsAsHeic(files[i].path)) heic.push_back(i);
  }
  if (heic.empty()) return absl::OkStatus();
  std::optional<std::filesystem::path> folder = FindWhole(folders, kHeicFolder);
  if (!folder) {
    const Polling polling(stages.observer());
    ASSIGN_OR_RETURN(folder, ConvertAll(folders, stages, files, heic));
  }
  for (const size_t index : heic) files[index].path = *folder / JpegName(index);
  return absl::OkStatus();
}

}  // namespace pepeseg
