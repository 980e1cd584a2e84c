#include "server/worker_protocol/beneath_folder.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class BeneathFolderTest : public ::testing::Test {
 protected:
  BeneathFolderTest() : work_(temp_ / "work") {
    fs::create_directories(work_ / "sub");
    Write(temp_ / "secret", "secret");
    Write(work_ / "file", "mine");
    Write(work_ / "sub/file", "below");
  }

  static void Write(const fs::path& path, const std::string& bytes) {
    std::ofstream(path) << bytes;
  }
  std::string Bytes(const fs::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  BeneathFolder Folder() { return BeneathFolder::Open(work_).value(); }
  // Opens by the kernel and part by part, and checks that both agree. Returns "opened" or "error N"
  // with the errno.
  std::string Open(const std::string& name) {
    std::string said;
    const BeneathFolder folder = Folder();
    for (const bool by_kernel : {true, false}) {
      const Descriptor file(
          OpenBeneath(folder.descriptor(), name, O_RDONLY | O_NONBLOCK, by_kernel));
      const std::string now = file.get() >= 0 ? "opened" : absl::StrCat("error ", errno);
      EXPECT_TRUE(said.empty() || (said == "opened") == (now == "opened")) << name;
      said = now;
    }
    return said;
  }

  testing::TempFolder temp_;
  fs::path work_;
};

TEST_F(BeneathFolderTest, OpensFilesBelowTheFolder) {
  EXPECT_EQ(Open("file"), "opened");
  EXPECT_EQ(Open("sub/file"), "opened");
  EXPECT_EQ(Open("none"), absl::StrCat("error ", ENOENT));
  ASSERT_OK_AND_ASSIGN(const std::string bytes, Folder().ReadFile("sub/file", 100));
  EXPECT_EQ(bytes, "below");
  EXPECT_TRUE(absl::IsNotFound(Folder().ReadFile("none", 100).status()));
  EXPECT_TRUE(absl::IsNotFound(Folder().ReadFile("file/below", 100).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().ReadFile("file", 3).status()));
}

TEST_F(BeneathFolderTest, FollowsNoLinks) {
  fs::create_symlink(temp_ / "secret", work_ / "absolute");
  fs::create_symlink("../secret", work_ / "relative");
  fs::create_symlink("file", work_ / "inside");
  fs::create_directory_symlink(temp_.path(), work_ / "folder");
  fs::create_directory_symlink("sub", work_ / "folder_inside");
  for (const char* name : {"absolute", "relative", "inside", "folder/secret", "folder_inside/file",
                           "sub/../file", "../secret", "..", "/etc/passwd", ""}) {
    EXPECT_NE(Open(name), "opened") << name;
    EXPECT_FALSE(Folder().OpenFile(name).ok()) << name;
    EXPECT_FALSE(Folder().HasFile(name)) << name;
  }
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().OpenFolder("folder").status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().OpenFile("absolute").status()));
}

TEST_F(BeneathFolderTest, RejectsFifosAndDevices) {
  ASSERT_EQ(mkfifo((work_ / "pipe").c_str(), 0600), 0);
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().OpenFile("pipe").status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().ReadFile("pipe", 100).status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().OpenFile("sub").status()));
  if (mknod((work_ / "device").c_str(), S_IFCHR | 0600, makedev(1, 5)) == 0) {  // /dev/zero
    EXPECT_TRUE(absl::IsFailedPrecondition(Folder().OpenFile("device").status()));
  }
}

// Another thread swaps a folder with a link to the outside all the time. No file outside of the
// folder may be read.
TEST_F(BeneathFolderTest, StaysInsideWhileEntriesAreSwapped) {
  fs::create_directory_symlink(temp_.path(), work_ / "outside");
  Write(work_ / "sub/secret", "decoy");
  std::atomic<bool> done = false;
  std::thread swapping([&] {
    while (!done) {
      renameat2(AT_FDCWD, (work_ / "sub").c_str(), AT_FDCWD, (work_ / "outside").c_str(),
                RENAME_EXCHANGE);
    }
  });
  const BeneathFolder folder = Folder();
  int num_read = 0;
  // The scheduler may not run the other thread for a while.
  const absl::Time give_up = absl::Now() + absl::Seconds(30);
  for (int i = 0; i < 5000 || (num_read == 0 && absl::Now() < give_up); ++i) {
    const Descriptor file(
        OpenBeneath(folder.descriptor(), "sub/secret", O_RDONLY, /*by_kernel=*/i % 2 == 0));
    char bytes[8] = "";
    if (file.get() < 0 || read(file.get(), bytes, 6) <= 0) continue;
    ++num_read;
    ASSERT_STREQ(bytes, "decoy");
  }
  done = true;
  swapping.join();
  EXPECT_GT(num_read, 0);
}

TEST_F(BeneathFolderTest, ListsEntriesAndReportsFactsOfRegularFilesOnly) {
  fs::create_symlink(temp_ / "secret", work_ / "link");
  ASSERT_OK_AND_ASSIGN(const auto entries, Folder().List());
  std::vector<std::string> said;
  for (const auto& entry : entries) {
    said.push_back(absl::StrCat(entry.name, entry.is_folder ? "/" : entry.is_file ? "" : "?"));
  }
  EXPECT_THAT(said, ElementsAre("file", "link?", "sub/"));
  EXPECT_EQ(Folder().Look("file")->num_bytes, 4);
  EXPECT_FALSE(Folder().Look("link").has_value());
  EXPECT_FALSE(Folder().Look("sub").has_value());
  std::vector<std::string> visited;
  VisitFiles(Folder(),
             [&](const BeneathFolder&, const std::string& name) { visited.push_back(name); });
  EXPECT_THAT(visited, ElementsAre("file", "file"));
}

TEST_F(BeneathFolderTest, RejectsSymbolicAndHardLinks) {
  fs::remove_all(work_ / "sub");
  Write(work_ / "other", "12345");
  EXPECT_EQ(Folder().CheckPlain().value_or(-1), 9);
  fs::create_hard_link(temp_ / "secret", work_ / "taken");
  EXPECT_STATUS(Folder().CheckPlain(), absl::StatusCode::kFailedPrecondition, "work/taken");
  EXPECT_OK(Folder().CheckPlain(/*other_names=*/true).status());
  fs::remove(work_ / "taken");
  fs::create_symlink("file", work_ / "taken");
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().CheckPlain().status()));
  EXPECT_TRUE(absl::IsFailedPrecondition(Folder().CheckPlain(/*other_names=*/true).status()));
}

TEST_F(BeneathFolderTest, RemovesLinksButNotTheirTargets) {
  fs::create_directories(temp_ / "kept");
  Write(temp_ / "kept/file", "kept");
  fs::create_directory_symlink(temp_ / "kept", work_ / "link");
  fs::create_directory_symlink(temp_ / "kept", work_ / "sub/link");
  fs::create_hard_link(temp_ / "kept/file", work_ / "sub/hard");
  EXPECT_OK(Folder().RemoveAll("link"));
  EXPECT_OK(Folder().RemoveAll("sub"));
  EXPECT_OK(Folder().RemoveAll("none"));
  EXPECT_FALSE(fs::exists(fs::symlink_status(work_ / "link")) || fs::exists(work_ / "sub"));
  EXPECT_EQ(Bytes(temp_ / "kept/file"), "kept");
  EXPECT_FALSE(RemoveBeneath(temp_.path(), "work/../kept").ok());
  EXPECT_OK(RemoveBeneath(temp_.path(), "work/file"));
  EXPECT_FALSE(fs::exists(work_ / "file"));
}

// 2,000 levels are more than the default limit of open descriptors, and too deep for recursion.
TEST_F(BeneathFolderTest, RemovesFoldersOfAnyDepthAndPermissions) {
  const int depth = 2000;
  Descriptor folder(open((work_ / "sub").c_str(), O_RDONLY | O_DIRECTORY));
  for (int i = 0; i < depth; ++i) {
    ASSERT_EQ(mkdirat(folder.get(), "deeper", 0700), 0) << i;
    folder = Descriptor(openat(folder.get(), "deeper", O_RDONLY | O_DIRECTORY));
  }
  fs::create_directories(work_ / "sub/closed/below");
  Write(work_ / "sub/closed/below/file", "x");
  fs::permissions(work_ / "sub/closed/below", fs::perms::none);
  fs::permissions(work_ / "sub/closed", fs::perms::none);
  EXPECT_OK(Folder().RemoveAll("sub"));
  ASSERT_OK_AND_ASSIGN(const auto left, Folder().List());
  ASSERT_EQ(left.size(), 1u);
  EXPECT_EQ(left[0].name, "file");
}

}  // namespace
}  // namespace pepeseg
