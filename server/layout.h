#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

// Where things stand in the server's data directory. Only ids of our own making, numbers and
// digests become parts of a path: never a name that a client chose freely.
//
//   lock                      held by the one server that uses the directory
//   pepeseg.db                the store
//   audit.log                 who did what (server/access/audit_log.h)
//   blobs/ab/abcdef...        bytes of uploaded files, by SHA-256
//   datasets/SCENE/N.json     manifest of a sealed dataset
//   selections/SCENE/N        members of a selection (core/io/selection_file.h)
//   jobs/JOB/...              of server/jobs
namespace pepeseg {

inline std::filesystem::path LockPath(const std::filesystem::path& data) { return data / "lock"; }

inline std::filesystem::path DatabasePath(const std::filesystem::path& data) {
  return data / "pepeseg.db";
}

inline std::filesystem::path AuditPath(const std::filesystem::path& data) {
  return data / "audit.log";
}

inline std::filesystem::path BlobFolder(const std::filesystem::path& data) {
  return data / "blobs";
}

// `sha256`: 64 lower-case hex digits, checked by the caller.
inline std::filesystem::path BlobPath(const std::filesystem::path& data, std::string_view sha256) {
  return BlobFolder(data) / std::string(sha256.substr(0, 2)) / std::string(sha256);
}

inline std::filesystem::path DatasetManifestPath(const std::filesystem::path& data,
                                                 std::string_view scene, int64_t number) {
  return data / "datasets" / std::string(scene) / (std::to_string(number) + ".json");
}

// Below the data directory.
inline std::filesystem::path SelectionFolder(std::string_view scene) {
  return std::filesystem::path("selections") / std::string(scene);
}

}  // namespace pepeseg
