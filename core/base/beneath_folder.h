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

// A file descriptor, closed by its owner's destructor.
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

// Opens `relative` below the folder with descriptor `folder`: no part of it is a link, ".." or
// absolute, so that nothing above the folder or beside it is opened, also while others change what
// is in it. Returns -1 and sets errno like open(). Needs Linux 5.6 (openat2); on older kernels, and
// where `by_kernel` is false, it opens part by part.
int OpenBeneath(int folder, const std::filesystem::path& relative, int flags,
                bool by_kernel = true);

// The way to files that a worker writes, for who does not trust the worker: links are never
// followed, FIFOs and devices never opened for use, and removal stays inside. All calls take paths
// relative to the folder; errors name the file by that path.
class BeneathFolder {
 public:
  struct Entry {
    std::string name;
    bool is_folder = false;
    bool is_file = false;  // a regular one
  };
  struct Facts {
    int64_t num_bytes = 0;
    int64_t num_names = 0;  // 1: it has no other (hard link)
    absl::Time modified;
  };

  // `path` is trusted: it may have links in it. NOT_FOUND: there is no such folder.
  static absl::StatusOr<BeneathFolder> Open(const std::filesystem::path& path);
  // A folder below this one. FAILED_PRECONDITION: it is something else.
  absl::StatusOr<BeneathFolder> OpenFolder(const std::filesystem::path& relative) const;

  // A regular file, for reading. NOT_FOUND: there is none; FAILED_PRECONDITION: it is something
  // else, or may not be read.
  absl::StatusOr<Descriptor> OpenFile(const std::filesystem::path& relative) const;
  // All of it; FAILED_PRECONDITION also: over `max_bytes`.
  absl::StatusOr<std::string> ReadFile(const std::filesystem::path& relative,
                                       int64_t max_bytes) const;
  // Whether there is a regular file of that name.
  bool HasFile(const std::filesystem::path& relative) const;

  // Sorted by name.
  absl::StatusOr<std::vector<Entry>> List() const;
  // None: it is not there any more, or is no regular file.
  std::optional<Facts> Look(const std::string& name) const;
  // The bytes of its files. FAILED_PRECONDITION, naming the first: an entry that is no regular
  // file, or, unless `other_names`, one that has a second name.
  absl::StatusOr<int64_t> CheckPlain(bool other_names = false) const;

  // Removes a file, or a folder with all that is in it. What is not there is removed already.
  absl::Status RemoveAll(const std::string& name) const;

  int descriptor() const { return folder_.get(); }

 private:
  BeneathFolder(Descriptor folder, std::filesystem::path name)
      : folder_(std::move(folder)), name_(std::move(name)) {}
  std::string Name(const std::filesystem::path& relative) const;

  Descriptor folder_;
  std::filesystem::path name_;  // in errors
};

// Removes what is at `relative` below the trusted `folder`, as BeneathFolder::RemoveAll does.
absl::Status RemoveBeneath(const std::filesystem::path& folder,
                           const std::filesystem::path& relative);

// Calls `visit` with each regular file below `folder`, without following links: the folder
// that it is in, and its name. Folders more than 64 levels deep are left out.
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
