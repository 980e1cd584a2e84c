#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

// Where things stand in the server's data directory. Only ids of our own making, numbers, digests
// and ids that follow a strict rule become parts of a path: never a name that a client chose
// freely. SCENE is SceneFolderName of a scene's id.
//
//   lock                      held by the one server that uses the directory
//   pepeseg.db                the store
//   audit.log                 who did what (server/access/audit_log.h)
//   refused.log               calls without a valid key (server/access/refusal_log.h)
//   collector.lock            held by the one server that collects what nothing refers to
//   locks/PROJECT             shared by who counts on a blob that is there, held by who removes one
//   blobs/PROJECT/ab/abcd...  bytes of uploaded files, by SHA-256
//   damaged/PROJECT/abcd...   blobs whose bytes had another digest when they were read again
//   partial/PROJECT/SCENE-N/  beginnings of the files of an upload, by SHA-256, and DIGEST.length:
//                             how many of their bytes are committed
//   scratch/                  pictures on their way to a client; no file in it has a name for long
//   datasets/SCENE/N.json     manifest of a sealed dataset
//   selections/SCENE/N        members of a selection (core/model_files/selection_file.h)
//   jobs/JOB/...              of server/jobs
namespace pepeseg {

inline std::filesystem::path LockPath(const std::filesystem::path& data) { return data / "lock"; }

inline std::filesystem::path DatabasePath(const std::filesystem::path& data) {
  return data / "pepeseg.db";
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

// A file's bytes, as a project has them.
struct BlobName {
  std::string project;
  std::string sha256;  // 64 lower-case hex digits, checked by who makes it
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

// The id of a scene as a folder's name, which differs from all others also where a file system does
// not tell upper from lower case: in lower case, with '_' before what was a capital, "__" for '_'
// and
// "_-" for '.'. Ids of lower-case letters, digits and '-' stay as they are.
inline std::string SceneFolderName(std::string_view scene) {
  std::string name;
  for (const char c : scene) {
    if (c == '_' || c == '.') {
      name += c == '_' ? "__" : "_-";
    } else if (c >= 'A' && c <= 'Z') {
      name += {'_', static_cast<char>(c - 'A' + 'a')};
    } else {
      name += c;
    }
  }
  return name;
}

// The scene whose SceneFolderName it is; empty: it is none's.
inline std::string SceneOfFolderName(std::string_view name) {
  std::string scene;
  for (size_t i = 0; i < name.size(); ++i) {
    if (name[i] != '_') {
      scene += name[i];
    } else if (const char next = ++i < name.size() ? name[i] : '\0'; next == '_' || next == '-') {
      scene += next == '_' ? '_' : '.';
    } else if (next >= 'a' && next <= 'z') {
      scene += static_cast<char>(next - 'a' + 'A');
    } else {
      return "";
    }
  }
  return SceneFolderName(scene) == name ? scene : "";
}

struct UploadName {
  std::string project;
  std::string scene;
  int64_t number = 0;
};

inline std::filesystem::path PartialFolderOf(const std::filesystem::path& data,
                                             const UploadName& upload) {
  return PartialFolder(data) / upload.project /
         (SceneFolderName(upload.scene) + "-" + std::to_string(upload.number));
}

// Of the beginning of a file: how many bytes of it are committed.
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

inline std::filesystem::path SelectionsFolder(const std::filesystem::path& data) {
  return data / "selections";
}

inline std::filesystem::path DatasetManifestPath(const std::filesystem::path& data,
                                                 std::string_view scene, int64_t number) {
  return data / "datasets" / SceneFolderName(scene) / (std::to_string(number) + ".json");
}

// Below the data directory.
inline std::filesystem::path SelectionFolder(std::string_view scene) {
  return std::filesystem::path("selections") / SceneFolderName(scene);
}

}  // namespace pepeseg
