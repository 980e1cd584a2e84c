#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace pepeseg {

// Owns a file descriptor and closes it. -1: none.
class Descriptor {
 public:
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor();
  Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  int get() const { return number_; }

 private:
  int number_;
};

// Opens `relative` below the folder with descriptor `folder`. Refuses a path that is absolute, has
// ".." in it, or leads through a symbolic link, so that only files below the folder can be opened,
// even while another process changes the folder. Returns -1 and sets errno as open() does. Uses
// openat2 (Linux 5.6); on older kernels, and if `by_kernel` is false, opens part by part.
int OpenBeneath(int folder, const std::filesystem::path& relative, int flags,
                bool by_kernel = true);

// Access to files that an untrusted worker writes. Never follows symbolic links, never returns a
// FIFO or device, and removes nothing outside the folder. All methods take paths relative to the
// folder; errors name files by that path, below the folder's own name.
class BeneathFolder {
 public:
  struct Entry {
    std::string name;
    bool is_folder = false;
    bool is_file = false;  // a regular file
  };
  struct Facts {
    int64_t num_bytes = 0;
    int64_t num_names = 0;  // hard links; 1: it has only this name
    absl::Time modified;
  };

  // Opens a folder. `path` is trusted and may lead through links. NOT_FOUND: there is no such
  // folder.
  static absl::StatusOr<BeneathFolder> Open(const std::filesystem::path& path);
  // Opens a folder below this one. NOT_FOUND: there is none. FAILED_PRECONDITION: the path leads
  // through a link, or may not be opened.
  absl::StatusOr<BeneathFolder> OpenFolder(const std::filesystem::path& relative) const;

  // Opens a regular file for reading. NOT_FOUND: there is none. FAILED_PRECONDITION: it is not a
  // regular file, or may not be read.
  absl::StatusOr<Descriptor> OpenFile(const std::filesystem::path& relative) const;
  // Returns the bytes of a regular file. Errors as OpenFile, and FAILED_PRECONDITION if it is
  // larger than `max_bytes`.
  absl::StatusOr<std::string> ReadFile(const std::filesystem::path& relative,
                                       int64_t max_bytes) const;
  // Copies the folder's regular files to the folder `to`, where they must not exist yet. Other
  // entries are left out. FAILED_PRECONDITION: see OpenFile, or the files have more than
  // `max_bytes`.
  absl::Status CopyFiles(const std::filesystem::path& to, int64_t max_bytes) const;
  // Returns true if OpenFile succeeds.
  bool HasFile(const std::filesystem::path& relative) const;

  // Returns the entries of the folder, sorted by name, without "." and "..".
  absl::StatusOr<std::vector<Entry>> List() const;
  // Returns facts about a regular file, or nothing if it no longer exists or is something else.
  std::optional<Facts> Look(const std::string& name) const;
  // Returns the total size of the folder's files in bytes. FAILED_PRECONDITION, naming the first
  // such entry: an entry is not a regular file or, unless `other_names`, has a second hard link.
  absl::StatusOr<int64_t> CheckPlain(bool other_names = false) const;

  // Removes a file, or a folder with everything in it, whatever its depth and permissions. Returns
  // OK if it does not exist.
  absl::Status RemoveAll(const std::string& name) const;

  int descriptor() const { return folder_.get(); }

 private:
  BeneathFolder(Descriptor folder, std::filesystem::path name)
      : folder_(std::move(folder)), name_(std::move(name)) {}
  std::string Name(const std::filesystem::path& relative) const;

  Descriptor folder_;
  std::filesystem::path name_;  // for errors
};

// Removes `relative` below the trusted `folder`, as BeneathFolder::RemoveAll does. Returns OK if
// either does not exist.
absl::Status RemoveBeneath(const std::filesystem::path& folder,
                           const std::filesystem::path& relative);

// Calls visit(parent, name) for each regular file below `folder`, without following links. `parent`
// is the BeneathFolder that the file is in. Skips folders that cannot be opened, and those more
// than 64 levels deep.
template <typename Visit>
void VisitFiles(const BeneathFolder& folder, const Visit& visit, int depth = 0) {
  constexpr int kMaxDepth = 64;
  const auto entries = folder.List();
  if (!entries.ok()) return;
  for (const BeneathFolder::Entry& entry : *entries) {
    if (entry.is_file) visit(folder, entry.name);
    if (entry.is_folder && depth < kMaxDepth) {
      const auto below = folder.OpenFolder(entry.name);
      if (below.ok()) VisitFiles(*below, visit, depth + 1);
    }
  }
}

}  // namespace pepeseg
