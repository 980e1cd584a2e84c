#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "server/store/scene_ref.h"

// The layout of the server's data directory. Only ids that the server made, numbers, digests and
// ids that follow a strict rule become parts of a path, never a name that a client chose freely.
// SCENE is SceneRef::id.
//
//   lock                      held by the one server that uses the directory
//   pepeseg.db                the SQLite database
//   database-id               identity of the database (server/data/data_identity.h)
//   audit.log                 who did what (server/access/audit_log.h)
//   refused.log               calls without a valid key (server/access/audit_log.h)
//   collector.lock            held by the one server that collects garbage
//   locks/PROJECT             lock: shared while a client relies on stored blobs, exclusive while
//                             blobs are removed
//   blobs/PROJECT/ab/abcd...  bytes of uploaded files, by SHA-256
//   damaged/PROJECT/abcd...   blobs whose bytes had another digest when they were read again
//   partial/PROJECT/SCENE-N/  partial uploads of files by SHA-256; next to each, DIGEST.length: the
//                             number of its bytes that are committed
//   scratch/                  decoded images on their way to a client, unlinked once opened; for a
//                             moment the Gaussians of a job in training
//   datasets/SCENE/N.json     manifest of a sealed dataset
//   selections/SCENE/N        members of a selection (core/model_files/model_file.h)
//   models/SCENE/N/           a corrected or edited model; files that a correction leaves as they
//   are have
//                             further names here (hard links)
//   jobs/JOB/...              job folders (server/worker_protocol/job_folder.h)
namespace pepeseg {

inline std::filesystem::path LockPath(const std::filesystem::path& data) { return data / "lock"; }

inline std::filesystem::path DatabasePath(const std::filesystem::path& data) {
  return data / "pepeseg.db";
}

inline std::filesystem::path IdentityPath(const std::filesystem::path& data) {
  return data / "database-id";
}

inline std::filesystem::path AuditPath(const std::filesystem::path& data) {
  return data / "audit.log";
}

inline std::filesystem::path RefusalPath(const std::filesystem::path& data) {
  return data / "refused.log";
}

inline std::filesystem::path BlobFolder(const std::filesystem::path& data) {
  return data / "blobs";
}

inline std::filesystem::path BlobFolderOf(const std::filesystem::path& data,
                                          std::string_view project) {
  return BlobFolder(data) / std::string(project);
}

inline std::filesystem::path BlobLockPath(const std::filesystem::path& data,
                                          std::string_view project) {
  return data / "locks" / std::string(project);
}

// Identifies the bytes of a file in a project.
struct BlobName {
  std::string project;
  std::string sha256;  // 64 lower-case hex digits; the caller has checked that
};

inline std::filesystem::path BlobPath(const std::filesystem::path& data, const BlobName& blob) {
  return BlobFolderOf(data, blob.project) / blob.sha256.substr(0, 2) / blob.sha256;
}

inline std::filesystem::path DamagedFolder(const std::filesystem::path& data) {
  return data / "damaged";
}

inline std::filesystem::path DamagedPath(const std::filesystem::path& data, const BlobName& blob) {
  return DamagedFolder(data) / blob.project / blob.sha256;
}

inline std::filesystem::path PartialFolder(const std::filesystem::path& data) {
  return data / "partial";
}

// Identifies an upload: a dataset that is still open.
struct UploadName {
  SceneRef scene;
  int64_t number = 0;
};

inline std::filesystem::path PartialFolderOf(const std::filesystem::path& data,
                                             const UploadName& upload) {
  return PartialFolder(data) / upload.scene.project /
         (std::to_string(upload.scene.id) + "-" + std::to_string(upload.number));
}

// Returns the file next to a partial upload that says how many of its bytes are committed.
inline std::filesystem::path LengthPath(const std::filesystem::path& partial) {
  return partial.string() + ".length";
}

inline std::filesystem::path CollectorLockPath(const std::filesystem::path& data) {
  return data / "collector.lock";
}

inline std::filesystem::path ScratchFolder(const std::filesystem::path& data) {
  return data / "scratch";
}

inline std::filesystem::path JobsFolder(const std::filesystem::path& data) { return data / "jobs"; }

inline std::filesystem::path DatasetsFolder(const std::filesystem::path& data) {
  return data / "datasets";
}

inline std::filesystem::path DatasetFolder(const std::filesystem::path& data,
                                           const SceneRef& scene) {
  return DatasetsFolder(data) / std::to_string(scene.id);
}

inline std::filesystem::path SelectionsFolder(const std::filesystem::path& data) {
  return data / "selections";
}

inline std::filesystem::path DatasetManifestPath(const std::filesystem::path& data,
                                                 const SceneRef& scene, int64_t number) {
  return DatasetFolder(data, scene) / (std::to_string(number) + ".json");
}

// Returns a path relative to the data directory.
inline std::filesystem::path SelectionFolder(const SceneRef& scene) {
  return std::filesystem::path("selections") / std::to_string(scene.id);
}

inline std::filesystem::path ModelVersionsFolder(const std::filesystem::path& data) {
  return data / "models";
}

// Returns a path relative to the data directory.
inline std::filesystem::path ModelVersionFolder(const SceneRef& scene) {
  return std::filesystem::path("models") / std::to_string(scene.id);
}

}  // namespace pepeseg
