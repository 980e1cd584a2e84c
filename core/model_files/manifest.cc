#include "core/model_files/manifest.h"

#include <algorithm>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/file_json.h"
#include "nlohmann/json.hpp"

namespace pepeseg {
namespace {

using nlohmann::json;

constexpr int kVersion = 1;
constexpr int64_t kMaxManifestBytes = int64_t{16} << 20;
constexpr size_t kHexDigits = 64;  // of a SHA-256

// Returns true if the name is that of a file in the folder itself, so that a damaged manifest
// cannot name files elsewhere.
bool IsPlainName(const std::string& name) {
  return !name.empty() && name != "." && name != ".." && name.find('/') == std::string::npos &&
         name.find('\0') == std::string::npos;
}

// Parses one entry of "files". Returns false if it is malformed.
bool ParseEntry(const json& value, ManifestEntry& entry) {
  if (!value.is_object()) return false;
  const auto name = value.find("name");
  const auto size = value.find("size");
  const auto sha256 = value.find("sha256");
  if (name == value.end() || size == value.end() || sha256 == value.end()) return false;
  // An unsigned number beyond int64 becomes negative, which the check at the end refuses.
  if (!name->is_string() || !size->is_number_unsigned() || !sha256->is_string()) return false;
  entry = {name->get<std::string>(), size->get<int64_t>(), sha256->get<std::string>()};
  return IsPlainName(entry.name) && entry.size >= 0 && entry.sha256.size() == kHexDigits;
}

absl::Status Damaged(const std::filesystem::path& path, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(path.string(), ": ", why));
}

}  // namespace

bool Manifest::Lists(absl::string_view name) const {
  return std::any_of(files.begin(), files.end(),
                     [name](const ManifestEntry& entry) { return entry.name == name; });
}

absl::StatusOr<Manifest> BuildManifest(const std::filesystem::path& folder,
                                       std::span<const std::string> names) {
  Manifest manifest;
  for (const std::string& name : names) {
    std::error_code error;
    const auto size = std::filesystem::file_size(folder / name, error);
    if (error) return absl::NotFoundError(absl::StrCat((folder / name).string(), " is not there"));
    ASSIGN_OR_RETURN(std::string sha256, Sha256OfFile(folder / name));
    manifest.files.push_back({name, static_cast<int64_t>(size), std::move(sha256)});
  }
  return manifest;
}

absl::Status WriteManifest(const std::filesystem::path& folder, const Manifest& manifest) {
  json files = json::array();
  for (const ManifestEntry& entry : manifest.files) {
    files.push_back({{"name", entry.name}, {"size", entry.size}, {"sha256", entry.sha256}});
  }
  const json document = {{"version", kVersion}, {"files", std::move(files)}};
  return WriteFileAtomically(folder / kManifestName, document.dump(1) + "\n");
}

absl::StatusOr<Manifest> ReadManifest(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / kManifestName;
  ASSIGN_OR_RETURN(const std::string text, ReadFile(path, path.string(), kMaxManifestBytes));
  const absl::StatusOr<json> parsed = ParseFileJson(text);
  if (!parsed.ok()) return Damaged(path, parsed.status().message());
  const json& document = *parsed;
  if (!document.is_object()) return Damaged(path, "not a JSON object");
  // The version decides how the rest is read.
  const auto version = document.find("version");
  if (version == document.end() || *version != kVersion) return Damaged(path, "not version 1");
  const auto files = document.find("files");
  if (files == document.end() || !files->is_array()) return Damaged(path, "no list of files");
  Manifest manifest;
  for (const json& value : *files) {
    ManifestEntry entry;
    if (!ParseEntry(value, entry)) {
      return Damaged(path, absl::StrCat("file ", manifest.files.size(), " is malformed"));
    }
    manifest.files.push_back(std::move(entry));
  }
  return manifest;
}

absl::Status VerifyManifest(const std::filesystem::path& folder, const Manifest& manifest) {
  for (const ManifestEntry& entry : manifest.files) {
    const std::filesystem::path path = folder / entry.name;
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (error) return Damaged(path, "the manifest lists it, but it is not there");
    // The size first: a truncated file is found without reading it.
    if (static_cast<int64_t>(size) != entry.size) {
      return Damaged(path, absl::StrCat("has ", size, " bytes, its manifest says ", entry.size));
    }
    ASSIGN_OR_RETURN(const std::string sha256, Sha256OfFile(path));
    if (sha256 != entry.sha256) return Damaged(path, "its checksum differs from its manifest's");
  }
  return absl::OkStatus();
}

absl::StatusOr<ManifestEntry> FindListed(const std::filesystem::path& folder,
                                         const std::string& name) {
  ASSIGN_OR_RETURN(const Manifest manifest, ReadManifest(folder));
  const auto listed = std::find_if(manifest.files.begin(), manifest.files.end(),
                                   [&](const ManifestEntry& entry) { return entry.name == name; });
  if (listed != manifest.files.end()) return *listed;
  return Damaged(folder / name, "its manifest lists no such file");
}

absl::StatusOr<std::string> ReadListedFile(const std::filesystem::path& folder,
                                           const std::string& name, int64_t max_bytes) {
  ASSIGN_OR_RETURN(const ManifestEntry listed, FindListed(folder, name));
  absl::StatusOr<std::string> text = ReadFile(folder / name, name, max_bytes);
  if (absl::IsNotFound(text.status())) return Damaged(folder / name, "it is not there");
  RETURN_IF_ERROR(text.status());
  if (Sha256Hex(*text) != listed.sha256) {
    return Damaged(folder / name, "its checksum differs from its manifest's");
  }
  return text;
}

}  // namespace pepeseg
