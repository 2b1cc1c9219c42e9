// A job type of Flamenco (https://flamenco.blender.org): frames times shards of their samples, then one merge a frame.
// Put it into the folder 'scripts' beside flamenco-manager.

const JOB_TYPE = {
    label: "oscura",
    settings: [
        { key: "oscura", type: "string", required: true, default: "oscura", description: "The program" },
        { key: "scene", type: "string", subtype: "file_path", required: true, description: "The scene" },
        { key: "output", type: "string", subtype: "dir_path", required: true,
          description: "Folder of the parts and the pictures, seen by all workers" },
        { key: "name", type: "string", required: true, default: "picture", description: "Pictures are NAME.0001.exr" },
        { key: "frames", type: "string", required: true, default: "0", description: "Such as 1-10, 20" },
        { key: "samples", type: "int32", required: true, default: 128, description: "Samples a pixel" },
        { key: "shards", type: "int32", required: true, default: 4, description: "Parts that a frame is divided into" },
        { key: "options", type: "string", required: false, default: "--float",
          description: "Further options of 'oscura render', divided by spaces" },
    ],
};

// Samples go in blocks of eight: the ranges of the shards, without empty ones.
function ranges(samples, shards) {
    const blocks = Math.floor((samples + 7) / 8);
    const at = (shard) => Math.min(Math.floor(blocks * shard / shards) * 8, samples);
    const all = [];
    for (let shard = 0; shard < shards; shard++) {
        if (at(shard) < at(shard + 1)) {
            all.push([at(shard), at(shard + 1)]);
        }
    }
    return all;
}

function compileJob(job) {
    const settings = job.settings;
    const further = (settings.options || "").split(" ").filter((word) => word != "");
    for (const frame of frameChunker(settings.frames, 1)) {
        const number = ("0000" + frame).slice(-Math.max(4, frame.length));
        const name = settings.output + "/" + settings.name + "." + number;
        const parts = ranges(settings.samples, settings.shards);
        const files = parts.map((_, shard) => name + "." + shard + ".part");
        const merge = author.Task("merge-" + frame, "misc");
        merge.addCommand(author.Command("exec", {
            exe: settings.oscura,
            args: ["merge"].concat(files, ["-o", name + ".exr"]),
        }));
        parts.forEach(([from, until], shard) => {
            const part = settings.output + "/" + settings.name + ".####." + shard + ".part";
            const task = author.Task("render-" + frame + "-" + shard, "blender");
            task.addCommand(author.Command("exec", {
                exe: settings.oscura,
                args: ["render", settings.scene, "-o", part, "--frames", frame, "--spp", "" + settings.samples,
                       "--sample-range", from + ".." + until, "--checkpoint", part + ".checkpoint", "--resume",
                       "--progress", "plain"].concat(further),
            }));
            job.addTask(task);
            merge.addDependency(task);
        });
        job.addTask(merge);
    }
}
