#include "server/data/data_identity.h"

#include <gtest/gtest.h>

#include "core/base/file_io.h"
#include "server/store/layout.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg {
namespace {

TEST(DataIdentity, BindsTheFirstDirectoryToItsDatabase) {
  using enum absl::StatusCode;
  const testing::TempFolder first, other;
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open(testing::NewTestDatabase(first.path())));
  EXPECT_OK(CheckIdentity(*store, first.path()));
  EXPECT_OK(CheckIdentity(*store, first.path()));
  EXPECT_STATUS(CheckIdentity(*store, other.path()), kFailedPrecondition,
                "does not belong to the database");
  // What the message says to do after a restore.
  ASSERT_OK_AND_ASSIGN(const std::string id, store->Identity());
  EXPECT_EQ(id.size(), 32u);
  ASSERT_OK(WriteFileAtomically(IdentityPath(other.path()), id));
  EXPECT_OK(CheckIdentity(*store, other.path()));
}

TEST(DataIdentity, BindsADatabaseToItsDirectory) {
  using enum absl::StatusCode;
  const testing::TempFolder data, elsewhere;
  ASSERT_OK_AND_ASSIGN(const auto store, Store::Open(testing::NewTestDatabase(data.path())));
  ASSERT_OK(CheckIdentity(*store, data.path()));
  ASSERT_OK_AND_ASSIGN(const auto fresh, Store::Open(testing::NewTestDatabase(elsewhere.path())));
  EXPECT_STATUS(CheckIdentity(*fresh, data.path()), kFailedPrecondition,
                "as after a restore: remove");
  std::filesystem::remove(IdentityPath(data.path()));
  EXPECT_OK(CheckIdentity(*fresh, data.path()));
}

}  // namespace
}  // namespace pepeseg
