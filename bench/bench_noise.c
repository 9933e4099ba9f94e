#include "bench/bench_noise.h"

#include "cairn/random.h"

void bench_noise_poses(cairn_carmen_log_scans *log, uint64_t seed)
{
    cairn_random random = cairn_random_seed(seed, 1);

    for (int32_t i = 0; i < log->count; i++) {
        log->record[i].robot.x = cairn_random_uniform(&random, -10, 10);
        log->record[i].robot.y = cairn_random_uniform(&random, -10, 10);
        log->record[i].robot.theta = cairn_random_uniform(&random, -3, 3);
        log->record[i].laser = log->record[i].robot;
        log->record[i].scan.base_sensor = log->record[i].robot;
    }
}
