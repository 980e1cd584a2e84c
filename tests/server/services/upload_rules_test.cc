#include "server/services/upload_rules.h"

#include <gtest/gtest.h>

#include "tests/testing/status_testing.h"

namespace pepeseg {
namespace {

TEST(UploadPath, AcceptsCommonPaths) {
  for (const char* good : {"a", "images/0001.jpg", "sparse/0/cameras.bin", "a b/ü.png", "..a/b..",
                           ".hidden", "a/...", "-rf"}) {
    EXPECT_OK(CheckUploadPath(good, "path")) << good;
  }
  EXPECT_OK(CheckUploadPath(std::string(512, 'a'), "path"));
}

TEST(UploadPath, RefusesPathsThatEscapeTheFolder) {
  const std::string nul("a\0b", 3);
  for (const std::string& bad :
       {std::string(), std::string("../../x"), std::string("a/../b"), std::string("a/.."),
        std::string("./a"), std::string("a/./b"), std::string("/etc/passwd"), std::string("a//b"),
        std::string("a/"), std::string("a\\b"), nul, std::string("a\nb"), std::string("a\x7f"),
        std::string("\xff.jpg"), std::string("\xc0\xae\xc0\xae/x"), std::string(513, 'a')}) {
    const absl::Status status = CheckUploadPath(bad, "files[2].path");
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << bad;
    EXPECT_EQ(status.message().find("files[2].path"), 0u) << status;
  }
}

v1::CreateUploadRequest GoodRequest() {
  v1::CreateUploadRequest request;
  v1::FileDeclaration* file = request.add_files();
  file->set_path("images/1.jpg");
  file->set_kind(v1::FILE_KIND_IMAGE);
  file->set_size(5);
  file->set_sha256(std::string(64, 'a'));
  *request.add_files() = *file;
  request.mutable_files(1)->set_path("images/2.jpg");
  return request;
}

void ExpectRefused(const v1::CreateUploadRequest& request, const std::string& words) {
  const auto files = CheckUploadFiles(request);
  ASSERT_TRUE(absl::IsInvalidArgument(files.status())) << words;
  EXPECT_NE(files.status().message().find(words), std::string::npos) << files.status();
}

TEST(UploadFiles, ReturnDeclaredFiles) {
  ASSERT_OK_AND_ASSIGN(const auto files, CheckUploadFiles(GoodRequest()));
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[1].path, "images/2.jpg");
  EXPECT_EQ(files[1].kind, v1::FILE_KIND_IMAGE);
  EXPECT_EQ(files[1].size, 5);
  EXPECT_FALSE(files[1].stored);
}

TEST(UploadFiles, NameFileAndLimitInRefusals) {
  ExpectRefused(v1::CreateUploadRequest(), "files: '0'");
  auto request = GoodRequest();
  request.mutable_files(1)->set_path("images/1.jpg");
  ExpectRefused(request, "files[1].path: 'images/1.jpg': listed twice");
  request = GoodRequest();
  request.mutable_files(1)->set_path("../../x");
  ExpectRefused(request, "files[1].path: '../../x'");
  request = GoodRequest();
  request.mutable_files(1)->set_size(0);
  ExpectRefused(request, "files[1].size: '0'");
  request.mutable_files(1)->set_size((int64_t{4} << 30) + 1);
  ExpectRefused(request, "allowed are 1..4294967296 bytes (of images/2.jpg)");
  request = GoodRequest();
  request.mutable_files(0)->set_kind(v1::FILE_KIND_UNSPECIFIED);
  ExpectRefused(request, "files[0].kind");
  request.mutable_files(0)->set_kind(static_cast<v1::FileKind>(99));
  ExpectRefused(request, "files[0].kind: '99'");
  request = GoodRequest();
  request.mutable_files(0)->set_sha256(std::string(64, 'A'));
  ExpectRefused(request, "files[0].sha256");
  request.mutable_files(0)->set_sha256("../../../../etc/passwd");
  ExpectRefused(request, "files[0].sha256");
}

TEST(UploadFiles, RefuseTooManyFilesAndPathBytes) {
  v1::CreateUploadRequest request;
  for (int i = 0; i < 20'001; ++i) {
    *request.add_files() = GoodRequest().files(0);
    request.mutable_files(i)->set_path("images/" + std::to_string(i));
  }
  ExpectRefused(request, "files: '20001'");
  request.mutable_files()->RemoveLast();
  EXPECT_OK(CheckUploadFiles(request));
  for (int i = 0; i < 5000; ++i) {
    request.mutable_files(i)->set_path(std::to_string(i) + std::string(500, 'x'));
  }
  ExpectRefused(request, "bytes of paths");
}

}  // namespace
}  // namespace pepeseg
