/* aligner: the terms of segments on their walls, of which the joint solution consists, and the
 * information about a scan that follows from them. aligner.c describes the method. */
#include "src/base/build.h"

#include "src/alignment/aligner_work.h"

aligner_term cairn_aligner_term_of(const cairn_aligner *aligner, const aligner_segment *segment)
{
    const aligner_wall *wall = &aligner->walls[segment->wall];
    cairn_transform pose = aligner->poses[segment->scan];
    cairn_vec2 mean = cairn_transform_point(pose, segment->mean), along = cairn_aligner_along(wall),
               n, t;
    cairn_vec2 arm = {mean.x - pose.x, mean.y - pose.y};
    cairn_real across;
    aligner_term m;

    /* The wall's axes in the scan's frame. */
    n = cairn_transform_inverse_direction(pose, wall->normal);
    t.x = n.y;
    t.y = -n.x;
    m.along = segment->scatter.xx * t.x * t.x + 2 * segment->scatter.xy * t.x * t.y +
              segment->scatter.yy * t.y * t.y;
    across = segment->scatter.xx * n.x * n.x + 2 * segment->scatter.xy * n.x * n.y +
             segment->scatter.yy * n.y * n.y;
    m.oblique = segment->scatter.xx * t.x * n.x + segment->scatter.xy * (t.x * n.y + t.y * n.x) +
                segment->scatter.yy * t.y * n.y;
    m.error = cairn_vec2_dot(wall->normal, mean) - wall->offset;
    m.chi = segment->weight * m.error * m.error + cairn_max(across - segment->min_scatter, 0);
    m.scale = 1 / (1 + m.chi / cairn_max(aligner->joint.robust_chi2,
                                         segment->weight * aligner->joint.robust_squared_distance));
    m.scale *= m.scale;
    m.row[0] = wall->normal.x;
    m.row[1] = wall->normal.y;
    m.row[2] = cairn_vec2_dot(along, arm);
    m.column[0] = -1;
    m.column[1] = -(cairn_vec2_dot(along, mean) - cairn_vec2_dot(along, wall->middle));
    m.column[2] = 0;
    return m;
}

cairn_sym3 cairn_aligner_own_information(const cairn_aligner *aligner, int32_t scan)
{
    cairn_sym3 own = cairn_sym3_zero();

    for (int32_t k = aligner->scans[scan].first_segment; k < aligner->scans[scan].end_segment;
         k++) {
        const aligner_segment *s = &aligner->segments[k];
        aligner_term m;

        if (!aligner_is_shared(aligner, s))
            continue;
        m = cairn_aligner_term_of(aligner, s);
        cairn_sym3_add_outer(&own, m.row, m.scale * s->weight);
        own.zz += m.scale * m.along;
    }
    return own;
}
