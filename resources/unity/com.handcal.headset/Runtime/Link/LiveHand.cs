using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>The newest frame of the live hand, from the chunks that have come.</summary>
    public sealed class LiveHand
    {
        const int MaxChunks = 250;
        readonly Points[] chunks = new Points[MaxChunks];
        uint frame;
        int chunkCount, arrived;
        bool isOutline, isChanged;

        /// <summary>x, y and z of <see cref="Count"/> points of frame W, m.</summary>
        public float[] PositionsM { get; private set; } = new float[3 * 4096];
        public int Count { get; private set; }

        /// <summary>True if the hand is rotated too far.</summary>
        public bool IsRed { get; private set; }

        /// <summary>True if the points are the hand's closed outline, in order.</summary>
        public bool IsOutline { get; private set; }

        /// <summary>The eyes that draw it.</summary>
        public Eyes Eyes { get; private set; } = Eyes.Both;

        /// <summary>Incremented whenever the points have changed.</summary>
        public int Version { get; private set; }

        /// <summary>Takes a chunk; one of an older frame is ignored.</summary>
        internal void Take(ProtoReader reader)
        {
            ulong number = 0, chunk = 0, count = 0;
            bool red = false, outline = false;
            Points points = Points.Nothing;
            var eyes = new List<ulong>(2);
            while (reader.Next(out int field))
            {
                switch (field)
                {
                    case 1: number = reader.Number(); break;
                    case 2: chunk = reader.Number(); break;
                    case 3: count = reader.Number(); break;
                    case 4: red = reader.Number() != 0; break;
                    case 5: points = new Points(reader.Message()); break;
                    case 6: outline = reader.Number() != 0; break;
                    case 7: reader.Numbers(eyes); break;
                }
            }
            Eyes drawing = Check.EyesOrBoth(eyes);
            if (number > uint.MaxValue || chunk >= count || count > MaxChunks)
                throw new MalformedException("a chunk of no live hand");
            if (number < frame) return;
            if (number > frame) Begin((uint)number, (int)count);
            if ((int)count != chunkCount || chunks[chunk] != null) return;
            chunks[chunk] = points;
            arrived++;
            IsRed = red;
            isOutline = outline;
            Eyes = drawing;
            isChanged = true;
        }

        /// <summary>Decodes the points that have come since; the receiving thread must wait.</summary>
        internal void Decode()
        {
            if (!isChanged) return;
            isChanged = false;
            Version++;
            int total = 0;
            for (int k = 0; k < chunkCount; k++) total += chunks[k] == null ? 0 : chunks[k].Count;
            bool isWhole = arrived == chunkCount;
            for (int k = 0; k < chunkCount && isWhole; k++)
                isWhole = chunks[k].Count == (total - k + chunkCount - 1) / chunkCount;
            if (PositionsM.Length < 3 * total) PositionsM = new float[3 * total];
            Count = total;
            IsOutline = isOutline && isWhole;
            int next = 0;
            for (int k = 0; k < chunkCount; k++)
            {
                if (chunks[k] == null) continue;
                if (isWhole) chunks[k].CopyTo(PositionsM, k, chunkCount);
                else chunks[k].CopyTo(PositionsM, next, 1);
                next += chunks[k].Count;
            }
        }

        void Begin(uint number, int count)
        {
            System.Array.Clear(chunks, 0, MaxChunks);
            frame = number;
            chunkCount = count;
            arrived = 0;
            isChanged = true;
        }
    }
}
