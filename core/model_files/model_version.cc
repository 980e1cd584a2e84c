#include "core/model_files/model_version.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <vector>

#include "absl/functional/function_ref.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/manifest.h"
#include "core/model_files/model_facts.h"
#include "core/model_files/model_file.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr char kFeaturesName[] = "features.bin";
constexpr char kFactsName[] = "model.json";
constexpr int64_t kMaxFactsBytes = int64_t{256} << 20;

// Gives a file a second name, or copies it.
absl::Status Share(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_hard_link(from, to, error);
  if (!error) return absl::OkStatus();
  fs::copy_file(from, to, error);
  return error ? FileError(to, "write", error.value()) : absl::OkStatus();
}

// Shares all files but those that a correction writes.
absl::Status ShareOthers(const fs::path& from, const fs::path& to) {
  std::error_code error;
  for (fs::directory_iterator entry(from, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const std::array<std::string, 3> written = {kFeaturesName, kFactsName, kManifestName};
    if (std::find(written.begin(), written.end(), name) != written.end()) continue;
    if (!fs::is_regular_file(entry->symlink_status())) continue;
    RETURN_IF_ERROR(Share(entry->path(), to / name));
  }
  return error ? FileError(from, "list", error.value()) : absl::OkStatus();
}

absl::Status WriteFacts(const fs::path& from, const fs::path& to, const std::string& provenance) {
  ASSIGN_OR_RETURN(const std::string text, ReadListedFile(from, kFactsName, kMaxFactsBytes));
  Model facts;
  RETURN_IF_ERROR(ParseModelFacts(text, facts));
  facts.facts["corrected_from"] = provenance;
  return WriteFileAtomically(to / kFactsName, FormatModelFacts(facts));
}

absl::StatusOr<int64_t> SizeOf(const fs::path& folder) {
  int64_t sum = 0;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const auto size = entry->file_size(error);
    if (!error) sum += static_cast<int64_t>(size);
  }
  if (error) return FileError(folder, "list", error.value());
  return sum;
}

absl::Status WriteCorrected(const fs::path& from, const fs::path& to, const FeatureField& field,
                            const std::string& provenance) {
  ASSIGN_OR_RETURN(const Manifest old, ReadManifest(from));
  RETURN_IF_ERROR(ShareOthers(from, to));
  RETURN_IF_ERROR(WriteFeatureFile(to / kFeaturesName, field));
  RETURN_IF_ERROR(WriteFacts(from, to, provenance));
  const std::vector<std::string> written = {kFeaturesName, kFactsName};
  ASSIGN_OR_RETURN(const Manifest fresh, BuildManifest(to, written));
  // The digests of shared files are those of before.
  Manifest manifest;
  for (const ManifestEntry& entry : old.files) {
    if (!fresh.Lists(entry.name)) manifest.files.push_back(entry);
  }
  manifest.files.insert(manifest.files.end(), fresh.files.begin(), fresh.files.end());
  return WriteManifest(to, manifest);
}

// Makes the folder, has `write` fill it, and returns the size of its files when they are durable.
// Removes it after an error.
absl::StatusOr<int64_t> MakeFolder(const fs::path& to, absl::FunctionRef<absl::Status()> write) {
  std::error_code error;
  fs::create_directories(to.parent_path(), error);
  if (error) return FileError(to.parent_path(), "create", error.value());
  // Returns false if it exists.
  if (!fs::create_directory(to, error)) {
    return FileError(to, "create", error ? error.value() : EEXIST);
  }
  const auto fill = [&]() -> absl::StatusOr<int64_t> {
    RETURN_IF_ERROR(write());
    RETURN_IF_ERROR(SyncFolder(to));
    RETURN_IF_ERROR(SyncFolder(to.parent_path()));
    RETURN_IF_ERROR(SyncFolder(to.parent_path().parent_path()));
    return SizeOf(to);
  };
  absl::StatusOr<int64_t> size = fill();
  if (!size.ok()) fs::remove_all(to, error);
  return size;
}

}  // namespace

absl::StatusOr<int64_t> WriteCorrectedModel(const fs::path& from, const fs::path& to,
                                            const FeatureField& field,
                                            const std::string& provenance) {
  return MakeFolder(to, [&] { return WriteCorrected(from, to, field, provenance); });
}

absl::StatusOr<int64_t> WriteEditedModel(const fs::path& to, const Model& model) {
  return MakeFolder(to, [&] { return WriteModel(to, model); });
}

}  // namespace pepeseg
