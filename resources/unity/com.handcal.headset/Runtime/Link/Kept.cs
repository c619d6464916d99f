using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>
    /// The projections received, by wearer; of one rig, the one that came last. They are kept
    /// without the PC: store <see cref="ToBytes"/>, and read it at the next start.
    /// </summary>
    public sealed class Kept
    {
        public const int MaxWearers = 16;
        readonly List<KeyValuePair<Projection, Projection>> all =
            new List<KeyValuePair<Projection, Projection>>();  // left and right, the newest last

        /// <summary>Number of wearers.</summary>
        public int Count { get { return all.Count; } }

        /// <summary>The projections of the newest wearer but `age`; null for an eye without one.</summary>
        public Projection Left(int age = 0) { return all[all.Count - 1 - age].Key; }
        public Projection Right(int age = 0) { return all[all.Count - 1 - age].Value; }

        /// <summary>Reads stored projections; raises MalformedException.</summary>
        public static Kept FromBytes(byte[] bytes)
        {
            var kept = new Kept();
            var reader = new ProtoReader(bytes);
            while (reader.Next(out int field))
                if (field == 1) kept.Add(new Projection(reader.Message()));
            return kept;
        }

        public byte[] ToBytes()
        {
            var writer = new ProtoWriter();
            foreach (KeyValuePair<Projection, Projection> one in all)
            {
                if (one.Key != null) writer.Message(1, one.Key.Write());
                if (one.Value != null) writer.Message(1, one.Value.Write());
            }
            return writer.ToArray();
        }

        /// <summary>Keeps a projection as the newest; those of another rig are dropped.</summary>
        internal void Add(Projection added)
        {
            Projection left = null, right = null;
            for (int i = all.Count - 1; i >= 0; i--)
            {
                Projection one = all[i].Key ?? all[i].Value;
                if (one.Rig == added.Rig && one.Wearer != added.Wearer) continue;
                if (one.Rig == added.Rig)
                {
                    left = all[i].Key;
                    right = all[i].Value;
                }
                all.RemoveAt(i);
            }
            if (added.Eye == Eyes.Left) left = added;
            else right = added;
            if (all.Count == MaxWearers) all.RemoveAt(0);
            all.Add(new KeyValuePair<Projection, Projection>(left, right));
        }

        /// <summary>Shows a wearer's projections again, as the newest; false if there are none.</summary>
        internal bool Recall(string wearer)
        {
            for (int i = 0; i < all.Count; i++)
            {
                if ((all[i].Key ?? all[i].Value).Wearer != wearer) continue;
                all.Add(all[i]);
                all.RemoveAt(i);
                return true;
            }
            return false;
        }
    }
}
