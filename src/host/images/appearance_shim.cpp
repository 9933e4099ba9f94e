// Implementation of appearance_shim.h by OpenCV: the plug-in libcairn-appearance.so.
#include <algorithm>
#include <cstdio>
#include <new>
#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/ml.hpp>

#include "cairn/status.h"
#include "src/host/images/appearance_shim.h"

namespace
{

constexpr int descriptor_size = CAIRN_APPEARANCE_SHIM_DESCRIPTOR_SIZE;
constexpr int min_side = 96;

// Writes an error message as one line and returns the status.
int32_t fail(int32_t status, const std::string &text, char *message, size_t capacity)
{
    std::string line(text);

    for (char &c : line)
        c = c == '\n' || c == '\t' ? ' ' : c;
    (void)std::snprintf(message, capacity, "%s", line.c_str());
    return status;
}

// While in scope OpenCV's log is silent and OpenCV uses one thread, because cairn distributes
// images among processes. The destructor restores the caller's settings.
class Quiet
{
  public:
    Quiet()
        : level(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)),
          threads(cv::getNumThreads())
    {
        cv::setNumThreads(0);
    }
    ~Quiet()
    {
        cv::setNumThreads(threads);
        cv::utils::logging::setLogLevel(level);
    }
    Quiet(const Quiet &) = delete;
    Quiet &operator=(const Quiet &) = delete;

  private:
    cv::utils::logging::LogLevel level;
    int threads;
};

// Runs a function that may throw; converts exceptions to statuses.
template <typename Work> int32_t guarded(char *message, size_t capacity, const Work &work) noexcept
{
    try {
        const Quiet quiet;

        return work();
    } catch (const cv::Exception &e) {
        return fail(e.code == cv::Error::StsNoMem ? CAIRN_NO_MEMORY : CAIRN_BAD_ARGUMENT, e.err,
                    message, capacity);
    } catch (const std::bad_alloc &) {
        return fail(CAIRN_NO_MEMORY, "no memory", message, capacity);
    } catch (const std::exception &e) {
        return fail(CAIRN_BAD_ARGUMENT, e.what(), message, capacity);
    } catch (...) {
        return fail(CAIRN_BAD_ARGUMENT, "unknown", message, capacity);
    }
}

int32_t describe(const uint8_t *grey, int32_t width, int32_t height,
                 const cairn_appearance_shim_keypoint *keypoints, int32_t count,
                 uint8_t *descriptors, char *message, size_t capacity)
{
    return guarded(message, capacity, [&]() -> int32_t {
        // OpenCV's Mat needs a mutable pointer; the image is not written.
        const cv::Mat picture(height, width, CV_8U, const_cast<uint8_t *>(grey));
        std::vector<cv::KeyPoint> points;
        cv::Mat large, found, bytes(count, descriptor_size, CV_8U, descriptors);

        // OpenCV 4.6 writes beyond its buffer where the image is smaller than a patch.
        cv::copyMakeBorder(picture, large, 0, std::max(0, min_side - height), 0,
                           std::max(0, min_side - width), cv::BORDER_REPLICATE);
        points.reserve(static_cast<size_t>(count));
        for (int32_t i = 0; i < count; i++)
            points.emplace_back(keypoints[i].x, keypoints[i].y, keypoints[i].size, 0.0F, 1.0F,
                                keypoints[i].octave, i);
        cv::SIFT::create()->compute(large, points, found);
        if (found.rows != count || found.cols != descriptor_size)
            return fail(CAIRN_BAD_ARGUMENT, "descriptors are missing", message, capacity);
        found.convertTo(bytes, CV_8U);
        return CAIRN_OK;
    });
}

int32_t train(const float *samples, const int32_t *is_class, int32_t count, int32_t width,
              double cost, double gamma, cairn_appearance_shim_machine *machine, char *message,
              size_t capacity)
{
    return guarded(message, capacity, [&]() -> int32_t {
        const cv::Mat table(count, width, CV_32F, const_cast<float *>(samples));
        cv::Mat labels(count, 1, CV_32S), alpha, index;
        const cv::Ptr<cv::ml::SVM> svm = cv::ml::SVM::create();

        for (int32_t i = 0; i < count; i++)
            labels.at<int32_t>(i) = is_class[i] != 0 ? 1 : 0;
        svm->setType(cv::ml::SVM::C_SVC);
        svm->setKernel(cv::ml::SVM::CHI2);
        svm->setC(cost);
        svm->setGamma(gamma);
        svm->setTermCriteria(
            cv::TermCriteria(cv::TermCriteria::MAX_ITER + cv::TermCriteria::EPS, 100000, 1e-7));
        if (!svm->train(table, cv::ml::ROW_SAMPLE, labels))
            return fail(CAIRN_BAD_ARGUMENT, "nothing was learnt", message, capacity);
        // OpenCV's sum is above rho for the lower label.
        machine->rho = -svm->getDecisionFunction(0, alpha, index);
        const cv::Mat support = svm->getSupportVectors();
        machine->count = static_cast<int32_t>(index.total());
        for (int32_t i = 0; i < machine->count; i++) {
            const float *row = support.ptr<float>(index.at<int32_t>(i));

            machine->weight[i] = -alpha.at<double>(i);
            for (int32_t k = 0; k < width; k++)
                machine->support[static_cast<size_t>(i) * static_cast<size_t>(width) +
                                 static_cast<size_t>(k)] = row[k];
        }
        return CAIRN_OK;
    });
}

const cairn_appearance_shim table = {CAIRN_APPEARANCE_SHIM_VERSION, describe, train};

} // namespace

const cairn_appearance_shim *cairn_appearance_shim_table()
{
    return &table;
}
