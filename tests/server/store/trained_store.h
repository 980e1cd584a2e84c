#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "server/store/store.h"
#include "tests/server/store/scene_of.h"
#include "tests/server/store/test_database.h"
#include "tests/testing/status_testing.h"
#include "tests/testing/temp_folder.h"

namespace pepeseg::testing {

// A store with the scenes "a", which has two models, and "b".
class TrainedStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    Reopen();
    ASSERT_OK(store_->scenes().CreateScene(NewScene("b")));
    MakeTrained("a");
  }
  void MakeTrained(const std::string& scene) {
    ASSERT_OK(store_->scenes().CreateScene(NewScene(scene)));
    ASSERT_OK(store_->datasets().CreateDataset(SceneOf(*store_, scene), "",
                                               {{"images/a.jpg", 1, 3, "00", true}}));
    ASSERT_OK(store_->datasets().SealDataset(SceneOf(*store_, scene), 1));
    for (int i = 0; i < 2; ++i) {
      JobRecord job;
      job.scene = SceneOf(*store_, scene);
      job.dataset = 1;
      ASSERT_OK_AND_ASSIGN(job, store_->jobs().CreateJob(job));
      ASSERT_OK(store_->queue().ClaimJob("cpu"));
      ASSERT_OK(store_->queue().CommitModel(job.id, 1, {}));
    }
  }
  void Reopen() {
    store_.reset();
    ASSERT_OK_AND_ASSIGN(store_, Store::Open(url_));
  }

  const TempFolder folder_;
  const std::string url_ = NewTestDatabase(folder_.path());
  std::unique_ptr<Store> store_;
};

}  // namespace pepeseg::testing
